//! The gather: irradiance from a camera's VPLs and sky at low-resolution pixels.

mod settings;
mod view;

use bevy::app::{App, Plugin};
use bevy::asset::{Handle, embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d,
    uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::{Shader, ShaderDefVal, load_shader_library};
use bevy::utils::default;

use super::compute::{CameraInputs, bind_group, compute_pass};
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::settings::{FrugalGi, GiVisibility};
use super::sky::{SET_BYTES, SkyCamera};
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::{VPL_BYTES, VplView};
pub(super) use settings::GatherSettings;
pub(super) use view::{
    GatherView, IRRADIANCE, irradiance_texture, low_resolution_texture, texture_bytes, texture_size,
};

pub(super) struct GatherPlugin;

impl Plugin for GatherPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "settings.wgsl");
        embedded_asset!(app, "gather.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<GatherPipelines>()
            .add_systems(
                Render,
                (
                    prepare_sky_pipelines.in_set(PrepareSystems::GatherPipelines),
                    (view::prepare, prepare_masked_pipelines).in_set(PrepareSystems::Gather),
                ),
            )
            .add_systems(Core3d, gather.in_set(PassSystems::Gather));
    }
}

fn first_of(buffer: &Buffer, size: u64) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(size) })
}

/// Key of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct GatherKind {
    pub visibility: GiVisibility,
    /// Needs rays.
    pub has_sky: bool,
    /// Whether rays test alpha masks.
    pub has_masks: bool,
}

/// Pipelines by kind. Plain kinds are queued from the beginning, those with a sky or alpha masks
/// once a camera needs them.
#[derive(Resource)]
pub(super) struct GatherPipelines {
    /// Without a sky and with one.
    layouts: [BindGroupLayoutDescriptor; 2],
    shader: Handle<Shader>,
    pipelines: HashMap<GatherKind, CachedComputePipelineId>,
}

impl FromWorld for GatherPipelines {
    fn from_world(world: &mut World) -> Self {
        let vpls = uniform_buffer_sized(
            true,
            BufferSize::new(u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES),
        );
        let settings =
            uniform_buffer_sized(true, BufferSize::new(size_of::<GatherSettings>() as u64));
        let read = || storage_buffer_read_only_sized(false, None);
        let write = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        let (g_buffer, depth, view) = (
            texture_2d(TextureSampleType::Uint),
            texture_depth_2d(),
            uniform_buffer::<ViewUniform>(true),
        );
        let sky = uniform_buffer_sized(true, BufferSize::new(SET_BYTES));
        let compute = ShaderStages::COMPUTE;
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, vpls, settings, read(), write),
        );
        let with_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, vpls, settings, read(), write, sky, read()),
        );
        let mut pipelines = Self {
            layouts: [
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/gather", &without_sky),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/gather/sky", &with_sky),
            ],
            shader: load_embedded_asset!(world, "gather.wgsl"),
            pipelines: default(),
        };
        let cache = world.resource::<PipelineCache>();
        for visibility in GiVisibility::ALL {
            pipelines.queue(cache, GatherKind { visibility, has_sky: false, has_masks: false });
        }
        pipelines
    }
}

impl GatherPipelines {
    /// The pipeline of a kind, queued if it was not before.
    pub(super) fn queue(
        &mut self,
        cache: &PipelineCache,
        kind: GatherKind,
    ) -> CachedComputePipelineId {
        let Self { layouts, shader, pipelines } = self;
        let GatherKind { visibility, has_sky, has_masks } = kind;
        *pipelines.entry(kind).or_insert_with(|| {
            let mut layout = vec![layouts[usize::from(has_sky)].clone()];
            let mut shader_defs = Vec::new();
            let mut label = format!("bevy_frugal_gi/gather/{visibility:?}");
            if visibility.rays() > 0 {
                layout.push(OccluderBuffers::layout());
                shader_defs.push(ShaderDefVal::UInt("RAYS".into(), visibility.rays()));
            }
            if has_sky {
                shader_defs.push(ShaderDefVal::UInt("SKY_RAYS".into(), visibility.sky_rays()));
                label += "/sky";
            }
            if has_masks {
                shader_defs.push("MASKS".into());
                label += "/masks";
            }
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(label.into()),
                layout,
                shader: shader.clone(),
                shader_defs,
                entry_point: Some("gather_vpls".into()),
                ..default()
            })
        })
    }

    /// The pipeline of a kind, if it is compiled; until then, the one that treats all triangles as
    /// solid.
    fn get<'a>(&self, cache: &'a PipelineCache, kind: GatherKind) -> Option<&'a ComputePipeline> {
        let compiled = |kind| cache.get_compute_pipeline(*self.pipelines.get(&kind)?);
        compiled(kind).or_else(|| compiled(GatherKind { has_masks: false, ..kind }))
    }
}

/// Queues the pipelines that gather a sky, and keeps a sky inactive until its own is compiled.
fn prepare_sky_pipelines(
    mut pipelines: ResMut<GatherPipelines>,
    cache: Res<PipelineCache>,
    mut skies: Query<(&FrugalGi, &mut SkyCamera)>,
) {
    for (gi, mut sky) in &mut skies {
        let kind = GatherKind { visibility: gi.visibility, has_sky: true, has_masks: false };
        let pipeline = pipelines.queue(&cache, kind);
        sky.is_active &= cache.get_compute_pipeline(pipeline).is_some();
    }
}

/// Queues the pipelines that test alpha masks, where there are any.
fn prepare_masked_pipelines(
    mut pipelines: ResMut<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    cameras: Query<(&FrugalGi, Has<SkyCamera>)>,
) {
    if !occluders.are_masked() {
        return;
    }
    for (gi, has_sky) in cameras.iter().filter(|(gi, _)| gi.traces()) {
        // The sky may be inactive.
        for has_sky in [false, has_sky] {
            pipelines
                .queue(&cache, GatherKind { visibility: gi.visibility, has_sky, has_masks: true });
        }
    }
}

/// In a GI camera's view: gathers, set by set.
pub(super) fn gather(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &GatherView,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        Option<&SkyCamera>,
    )>,
    pipelines: Res<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, gather, prepass, view_offset, sky) = view.into_inner();
    if !view.work.gather {
        return;
    }
    let sky = sky.filter(|_| view.sky_samples > 0);
    let is_traced = view.gi.visibility != GiVisibility::None;
    let kind = GatherKind {
        visibility: view.gi.visibility,
        has_sky: sky.is_some(),
        has_masks: is_traced && occluders.are_masked(),
    };
    let (Some(camera), Some(pipeline)) =
        (CameraInputs::new(prepass, &view_uniforms), pipelines.get(&cache, kind))
    else {
        return;
    };
    let traced = if is_traced { occluders.bind_group() } else { None };
    let entries = DynamicBindGroupEntries::sequential((
        camera.g_buffer,
        camera.depth,
        camera.views,
        first_of(&vpl.vpls, u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES),
        gather.first_settings(),
        vpl.plan_buffer.as_entire_binding(),
        &gather.irradiance.default_view,
    ));
    let entries = match sky {
        Some(sky) => entries.extend_sequential((
            first_of(&sky.samples, SET_BYTES),
            sky.plan_buffer.as_entire_binding(),
        )),
        None => entries,
    };
    let layout = &pipelines.layouts[usize::from(sky.is_some())];
    let bind_group = bind_group(&context, &cache, layout, &entries);
    let size = gather.irradiance.texture.size();
    compute_pass(&mut context, "bevy_frugal_gi/gather", &[], |pass| {
        pass.set_pipeline(pipeline);
        if let Some(traced) = traced {
            pass.set_bind_group(1, traced, &[]);
        }
        let across = 8 * vpl.plan.interleave;
        for set in 0..vpl.plan.sets {
            let settings = set * settings::SETTINGS_STRIDE as u32;
            let offsets =
                [view_offset.offset, vpl.plan.offset(set), settings, set * SET_BYTES as u32];
            pass.set_bind_group(0, &bind_group, &offsets[..if sky.is_some() { 4 } else { 3 }]);
            pass.dispatch_workgroups(size.width.div_ceil(across), size.height.div_ceil(across), 1);
        }
    });
}

//! The gather: irradiance from a camera's VPLs at a share of its pixels.

mod camera;
mod plan;
mod work;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d,
    uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

use super::settings::{FrugalGi, GiVisibility};
use super::sources::{SET_BYTES, SkyCamera};
use super::visibility::OccluderBuffers;
use super::vpl::VPL_BYTES;
pub use camera::GiCamera;
use camera::first_of;
pub(super) use camera::prepare_cameras;
pub(super) use plan::{GatherSettings, VplPlan};

/// What pipelines differ by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct GatherKind {
    pub visibility: GiVisibility,
    /// Takes rays.
    pub has_sky: bool,
    /// Whether rays look for holes.
    pub has_masks: bool,
}

/// Those of plain kinds are there from the beginning; with a sky or with holes once a camera has
/// asked for them.
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
            pipelines.demand(cache, GatherKind { visibility, has_sky: false, has_masks: false });
        }
        pipelines
    }
}

impl GatherPipelines {
    /// The pipeline of a kind; compiled from now on where it was not asked for before.
    pub(super) fn demand(
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

    /// The pipeline of a kind, if it is compiled; until then, one that takes all that rays meet for
    /// solid.
    fn get<'a>(&self, cache: &'a PipelineCache, kind: GatherKind) -> Option<&'a ComputePipeline> {
        let compiled = |kind| cache.get_compute_pipeline(*self.pipelines.get(&kind)?);
        compiled(kind).or_else(|| compiled(GatherKind { has_masks: false, ..kind }))
    }
}

/// Asks for the pipelines that look for holes, where there are any.
pub(super) fn prepare_pipelines(
    mut pipelines: ResMut<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    cameras: Query<(&FrugalGi, Has<SkyCamera>)>,
) {
    if !occluders.are_masked() {
        return;
    }
    for (gi, has_sky) in cameras.iter().filter(|(gi, _)| gi.traces()) {
        // A sky may turn out to send nothing.
        for has_sky in [false, has_sky] {
            pipelines
                .demand(&cache, GatherKind { visibility: gi.visibility, has_sky, has_masks: true });
        }
    }
}

/// In a GI camera's view: gathers, set by set.
pub(super) fn gather(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset, Option<&SkyCamera>)>,
    pipelines: Res<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset, sky) = view.into_inner();
    if !camera.work.gather {
        return;
    }
    let sky = sky.filter(|_| camera.sky_samples > 0);
    let is_traced = camera.visibility != GiVisibility::None;
    let kind = GatherKind {
        visibility: camera.visibility,
        has_sky: sky.is_some(),
        has_masks: is_traced && occluders.are_masked(),
    };
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        pipelines.get(&cache, kind),
    ) else {
        return;
    };
    let traced = if is_traced { occluders.bind_group() } else { None };
    let entries = DynamicBindGroupEntries::sequential((
        g_buffer,
        depth,
        views,
        first_of(&camera.vpls, u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES),
        camera.first_settings(),
        camera.plan_buffer.as_entire_binding(),
        &camera.irradiance.default_view,
    ));
    let entries = match sky {
        Some(sky) => entries.extend_sequential((
            first_of(&sky.samples, SET_BYTES),
            sky.plan_buffer.as_entire_binding(),
        )),
        None => entries,
    };
    let layout = cache.get_bind_group_layout(&pipelines.layouts[usize::from(sky.is_some())]);
    let bind_group =
        context.render_device().create_bind_group("bevy_frugal_gi/gather", &layout, &entries);
    let size = camera.irradiance.texture.size();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/gather");
    {
        let mut pass = context.command_encoder().begin_compute_pass(&ComputePassDescriptor {
            label: Some("bevy_frugal_gi/gather"),
            timestamp_writes: None,
        });
        pass.set_pipeline(pipeline);
        if let Some(traced) = traced {
            pass.set_bind_group(1, traced, &[]);
        }
        let across = 8 * camera.plan.interleave;
        for set in 0..camera.plan.sets {
            let settings = set * plan::SETTINGS_STRIDE as u32;
            let offsets =
                [view_offset.offset, camera.plan.offset(set), settings, set * SET_BYTES as u32];
            pass.set_bind_group(0, &bind_group, &offsets[..if sky.is_some() { 4 } else { 3 }]);
            pass.dispatch_workgroups(size.width.div_ceil(across), size.height.div_ceil(across), 1);
        }
    }
    span.end(context.command_encoder());
}

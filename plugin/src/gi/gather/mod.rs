//! The gather: irradiance from a camera's VPLs and sky at low-resolution pixels.

mod view;

use bevy::app::{App, Plugin};
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::{ShaderDefVal, load_shader_library};

use super::compute::{CameraInputs, Kernel, compute_pass, definitions, drop_with, read};
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::settings::{FrugalGi, GiVisibility};
use super::sky::SkyCamera;
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::VplView;
pub(super) use view::{
    GatherSettings, GatherView, irradiance_texture, low_resolution_texture, texture_bytes,
    texture_size,
};

pub(super) struct GatherPlugin;

impl Plugin for GatherPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "settings.wgsl");
        load_shader_library!(app, "irradiance.wgsl");
        embedded_asset!(app, "gather.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<GatherKernels>()
            .add_observer(drop_with::<GiView, GatherView>)
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

/// What a gather takes into account.
#[derive(Clone, Copy)]
struct GatherKind {
    visibility: GiVisibility,
    /// Needs rays.
    has_sky: bool,
    /// Whether rays test alpha masks.
    has_masks: bool,
}

impl GatherKind {
    /// Index of its kernel.
    fn kernel(self) -> usize {
        if self.visibility.rays() == 0 { 0 } else { 1 + usize::from(self.has_sky) }
    }

    fn definitions(self) -> Vec<ShaderDefVal> {
        let rays = |name: &str, count| ShaderDefVal::UInt(name.into(), count);
        let mut all = definitions([(self.has_masks, "MASKS")]);
        if self.visibility.rays() > 0 {
            all.push(rays("RAYS", self.visibility.rays()));
        }
        if self.has_sky {
            all.push(rays("SKY_RAYS", self.visibility.sky_rays()));
        }
        all
    }
}

/// Pipelines without a sky and alpha masks are queued from the beginning, others once a camera needs
/// them.
///
/// Without rays; with rays; with rays and a sky.
#[derive(Resource)]
pub(super) struct GatherKernels([Kernel; 3]);

impl FromWorld for GatherKernels {
    fn from_world(world: &mut World) -> Self {
        let settings =
            uniform_buffer_sized(false, BufferSize::new(size_of::<GatherSettings>() as u64));
        let target =
            texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        let (g_buffer, depth, view) = (
            texture_2d(TextureSampleType::Uint),
            texture_depth_2d(),
            uniform_buffer::<ViewUniform>(true),
        );
        let compute = ShaderStages::COMPUTE;
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), settings, read(), target),
        );
        let with_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), settings, read(), target, read(), read()),
        );
        let shader = load_embedded_asset!(world, "gather.wgsl");
        let kernel = |label, entries: &[BindGroupLayoutEntry]| {
            Kernel::new(label, "gather_vpls", &shader, entries)
        };
        let traced = |kernel: Kernel| kernel.with_group(OccluderBuffers::layout());
        let mut kernels = Self([
            kernel("frugal_gi/gather", &without_sky),
            traced(kernel("frugal_gi/gather", &without_sky)),
            traced(kernel("frugal_gi/gather/sky", &with_sky)),
        ]);
        for visibility in GiVisibility::ALL {
            let kind = GatherKind { visibility, has_sky: false, has_masks: false };
            kernels.queue(world.resource(), kind);
        }
        kernels
    }
}

impl GatherKernels {
    fn queue(&mut self, cache: &PipelineCache, kind: GatherKind) {
        self.0[kind.kernel()].queue(cache, kind.definitions());
    }

    /// The pipeline of a kind, if it is compiled; until then, the one that treats all triangles as
    /// solid.
    fn get<'a>(&self, cache: &'a PipelineCache, kind: GatherKind) -> Option<&'a ComputePipeline> {
        let compiled = |kind: GatherKind| self.0[kind.kernel()].get(cache, &kind.definitions());
        compiled(kind).or_else(|| compiled(GatherKind { has_masks: false, ..kind }))
    }
}

/// Queues the pipelines that gather a sky, and keeps a sky inactive until its own is compiled.
fn prepare_sky_pipelines(
    mut kernels: ResMut<GatherKernels>,
    cache: Res<PipelineCache>,
    mut skies: Query<(&FrugalGi, &mut SkyCamera)>,
) {
    for (gi, mut sky) in &mut skies {
        let kind = GatherKind { visibility: gi.visibility, has_sky: true, has_masks: false };
        kernels.queue(&cache, kind);
        sky.is_active &= kernels.get(&cache, kind).is_some();
    }
}

/// Queues the pipelines that test alpha masks, where there are any.
fn prepare_masked_pipelines(
    mut kernels: ResMut<GatherKernels>,
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
            let kind = GatherKind { visibility: gi.visibility, has_sky, has_masks: true };
            kernels.queue(&cache, kind);
        }
    }
}

/// In a GI camera's view: gathers, all sets at once.
pub(super) fn gather(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &GatherView,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        Option<&SkyCamera>,
    )>,
    kernels: Res<GatherKernels>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, gather, prepass, view_offset, sky) = view.into_inner();
    if !view.work.gather || view.gi.caches() {
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
        (CameraInputs::new(prepass, &view_uniforms), kernels.get(&cache, kind))
    else {
        return;
    };
    let traced = if is_traced { occluders.bind_group() } else { None };
    let entries = DynamicBindGroupEntries::sequential((
        camera.g_buffer,
        camera.depth,
        camera.views,
        vpl.vpls.as_entire_binding(),
        gather.settings.as_entire_binding(),
        vpl.plan_buffer.as_entire_binding(),
        &gather.irradiance.default_view,
    ));
    let entries = match sky {
        Some(sky) => entries.extend_sequential((
            sky.samples.as_entire_binding(),
            sky.plan_buffer.as_entire_binding(),
        )),
        None => entries,
    };
    let bind_group = kernels.0[kind.kernel()].bind(&context, &cache, &entries);
    let size = gather.irradiance.texture.size();
    compute_pass(&mut context, "frugal_gi/gather", &[], |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[view_offset.offset]);
        if let Some(traced) = traced {
            pass.set_bind_group(1, traced, &[]);
        }
        let across = 8 * vpl.plan.interleave;
        let (width, height) = (size.width.div_ceil(across), size.height.div_ceil(across));
        pass.dispatch_workgroups(width, height, vpl.plan.sets);
    });
}

//! Denoising of gathered irradiance: a spatial filter over neighbouring low-resolution pixels, which
//! used different VPLs and rays, and then temporal accumulation.

mod history;

use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::ShaderDefVal;

use super::compute::{CameraInputs, Kernel, compute_pass, definitions, drop_with, read};
use super::gather::GatherView;
use super::schedule::PassSystems;
use super::settings::FrugalGi;
use super::view::GiView;
use super::vpl::VplView;
pub(super) use history::{History, prepare};
use history::{LENGTH_FORMAT, Reprojection};

/// Window sizes with a pipeline.
const WINDOWS: [u32; 3] = [2, 4, 8];
/// Window that averages the noise of rays where VPLs are not interleaved.
pub(super) const RAY_WINDOW: u32 = 4;

/// Side of the window in low-resolution pixels, above 1 where settings
/// [filter](FrugalGi::filters). It covers every set of VPLs once.
fn window(gi: &FrugalGi) -> u32 {
    let rays = if gi.visibility.rays() == 0 { 1 } else { RAY_WINDOW };
    gi.interleave.side().max(rays)
}

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "spatial.wgsl");
    embedded_asset!(app, "temporal.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<DenoiseKernels>()
        .add_observer(drop_with::<GiView, History>)
        .add_systems(Core3d, denoise.in_set(PassSystems::Denoise));
}

#[derive(Resource)]
pub(super) struct DenoiseKernels {
    spatial: Kernel,
    temporal: Kernel,
}

fn spatial_variant(window: u32) -> Vec<ShaderDefVal> {
    vec![ShaderDefVal::UInt("WINDOW".into(), window)]
}

/// `SMOOTH`: with the wider window.
fn temporal_variant(smooths: bool) -> Vec<ShaderDefVal> {
    definitions([(smooths, "SMOOTH")])
}

impl FromWorld for DenoiseKernels {
    fn from_world(world: &mut World) -> Self {
        let light = texture_2d(TextureSampleType::Float { filterable: false });
        let target = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
        let (g_buffer, depth, view) = (
            texture_2d(TextureSampleType::Uint),
            texture_depth_2d(),
            uniform_buffer::<ViewUniform>(true),
        );
        let reprojection =
            uniform_buffer_sized(false, BufferSize::new(size_of::<Reprojection>() as u64));
        let irradiance = target(TextureFormat::Rgba16Float);
        let compute = ShaderStages::COMPUTE;
        let spatial = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), light, irradiance),
        );
        let temporal = BindGroupLayoutEntries::sequential(
            compute,
            (
                g_buffer,
                depth,
                view,
                read(),
                light,
                light,
                reprojection,
                irradiance,
                light,
                target(LENGTH_FORMAT),
            ),
        );
        let (filter, accumulate) = (
            load_embedded_asset!(world, "spatial.wgsl"),
            load_embedded_asset!(world, "temporal.wgsl"),
        );
        let (spatial, temporal) = (
            Kernel::new("frugal_gi/denoise/spatial", "filter_spatially", &filter, &spatial),
            Kernel::new("frugal_gi/denoise/temporal", "accumulate", &accumulate, &temporal),
        );
        let cache = world.resource::<PipelineCache>();
        Self {
            spatial: spatial.queued(cache, WINDOWS.map(spatial_variant)),
            temporal: temporal.queued(cache, [false, true].map(temporal_variant)),
        }
    }
}

/// In a GI camera's view: filters the gathered irradiance spatially, and accumulates it over time.
pub(super) fn denoise(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &GatherView,
        &History,
        &ViewPrepassTextures,
        &ViewUniformOffset,
    )>,
    kernels: Res<DenoiseKernels>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, gather, history, prepass, view_offset) = view.into_inner();
    if !view.work.gather && !history.accumulates {
        return;
    }
    let (Some(camera), Some(pipeline), Some(previous)) = (
        CameraInputs::new(prepass, &view_uniforms),
        kernels.spatial.get(&cache, &spatial_variant(window(&view.gi))),
        &gather.previous,
    ) else {
        return;
    };
    let spatial = kernels.spatial.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            camera.g_buffer,
            camera.depth,
            camera.views.clone(),
            vpl.plan_buffer.as_entire_binding(),
            &gather.irradiance.default_view,
            &history.filtered.default_view,
        )),
    );
    let smooths = view.gi.visibility.rays() > 0;
    let temporal = kernels.temporal.get(&cache, &temporal_variant(smooths)).map(|pipeline| {
        let entries = BindGroupEntries::sequential((
            camera.g_buffer,
            camera.depth,
            camera.views,
            vpl.plan_buffer.as_entire_binding(),
            &history.filtered.default_view,
            &previous.default_view,
            history.reprojection.as_entire_binding(),
            &gather.irradiance.default_view,
            &history.lengths.default_view,
            &history.new_lengths.default_view,
        ));
        (pipeline, kernels.temporal.bind(&context, &cache, &entries))
    });
    let size = history.filtered.texture.size();
    compute_pass(&mut context, "frugal_gi/denoise", &[], |pass| {
        let (width, height) = (size.width.div_ceil(8), size.height.div_ceil(8));
        // The spatial filter's output stays while nothing is gathered.
        if view.work.gather {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &spatial, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
        if let Some((pipeline, bind_group)) = &temporal {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
    });
}

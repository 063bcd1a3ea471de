//! Denoising of gathered irradiance: a spatial filter over neighbouring low-resolution pixels, which
//! used different VPLs and rays, and then temporal accumulation.

mod history;

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
use bevy::shader::ShaderDefVal;
use bevy::utils::default;

use super::compute::{CameraInputs, bind_group, compute_pass};
use super::gather::{GatherSettings, GatherView};
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::settings::FrugalGi;
use super::view::GiView;
pub(super) use history::History;
use history::{LENGTH_FORMAT, Reprojection};

/// Window sizes with a pipeline.
const WINDOWS: [u32; 3] = [2, 4, 8];
/// Window that averages the noise of rays where VPLs are not interleaved.
const RAY_WINDOW: u32 = 4;

/// Side of the window in low-resolution pixels, above 1 where settings
/// [filter](FrugalGi::filters). It covers every set of VPLs once.
fn window(gi: &FrugalGi) -> u32 {
    let rays = if gi.visibility.rays() == 0 { 1 } else { RAY_WINDOW };
    gi.interleave.side().max(rays)
}

pub(super) struct DenoisePlugin;

impl Plugin for DenoisePlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "spatial.wgsl");
        embedded_asset!(app, "temporal.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<DenoisePipelines>()
            .add_systems(Render, history::prepare.in_set(PrepareSystems::Denoise))
            .add_systems(Core3d, denoise.in_set(PassSystems::Denoise));
    }
}

#[derive(Resource)]
pub(super) struct DenoisePipelines {
    layout: BindGroupLayoutDescriptor,
    pipelines: [CachedComputePipelineId; 3],
    temporal_layout: BindGroupLayoutDescriptor,
    /// Without the wider window, and with it.
    temporal: [CachedComputePipelineId; 2],
}

impl FromWorld for DenoisePipelines {
    fn from_world(world: &mut World) -> Self {
        let light = || texture_2d(TextureSampleType::Float { filterable: false });
        let settings =
            || uniform_buffer_sized(false, BufferSize::new(size_of::<GatherSettings>() as u64));
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/denoise/spatial",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    settings(),
                    light(),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let (shader, temporal_shader) = (
            load_embedded_asset!(world, "spatial.wgsl"),
            load_embedded_asset!(world, "temporal.wgsl"),
        );
        let cache = world.resource::<PipelineCache>();
        let pipelines = WINDOWS.map(|window| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/denoise/spatial/{window}").into()),
                layout: vec![layout.clone()],
                shader: shader.clone(),
                shader_defs: vec![ShaderDefVal::UInt("WINDOW".into(), window)],
                entry_point: Some("filter_spatially".into()),
                ..default()
            })
        });
        let temporal_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/denoise/temporal",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    settings(),
                    light(),
                    light(),
                    uniform_buffer_sized(false, BufferSize::new(size_of::<Reprojection>() as u64)),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                    light(),
                    texture_storage_2d(LENGTH_FORMAT, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let temporal = [vec![], vec!["SMOOTH".into()]].map(|shader_defs| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some("bevy_frugal_gi/denoise/temporal".into()),
                layout: vec![temporal_layout.clone()],
                shader: temporal_shader.clone(),
                shader_defs,
                entry_point: Some("accumulate".into()),
                ..default()
            })
        });
        Self { layout, pipelines, temporal_layout, temporal }
    }
}

/// In a GI camera's view: filters the gathered irradiance spatially, and accumulates it over time.
pub(super) fn denoise(
    view: ViewQuery<(&GiView, &GatherView, &History, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<DenoisePipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, gather, history, prepass, view_offset) = view.into_inner();
    if !view.work.gather && !history.accumulates {
        return;
    }
    let pipeline = WINDOWS
        .iter()
        .position(|window| *window == history.window)
        .map(|index| pipelines.pipelines[index]);
    let (Some(camera), Some(pipeline)) = (
        CameraInputs::new(prepass, &view_uniforms),
        pipeline.and_then(|pipeline| cache.get_compute_pipeline(pipeline)),
    ) else {
        return;
    };
    let spatial = bind_group(
        &context,
        &cache,
        &pipelines.layout,
        &BindGroupEntries::sequential((
            camera.g_buffer,
            camera.depth,
            camera.views.clone(),
            gather.first_settings(),
            &gather.irradiance.default_view,
            &history.filtered.default_view,
        )),
    );
    let smooths = view.gi.visibility.rays() > 0;
    let temporal =
        cache.get_compute_pipeline(pipelines.temporal[usize::from(smooths)]).map(|pipeline| {
            let entries = BindGroupEntries::sequential((
                camera.g_buffer,
                camera.depth,
                camera.views,
                gather.first_settings(),
                &history.filtered.default_view,
                &history.texture.default_view,
                history.reprojection.as_entire_binding(),
                &gather.irradiance.default_view,
                &history.lengths.default_view,
                &history.new_lengths.default_view,
            ));
            (pipeline, bind_group(&context, &cache, &pipelines.temporal_layout, &entries))
        });
    let size = history.filtered.texture.size();
    compute_pass(&mut context, "bevy_frugal_gi/denoise", &[], |pass| {
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

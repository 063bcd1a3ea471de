//! The filter: joins what neighbouring gathered pixels found with different VPLs and rays.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::ShaderDefVal;
use bevy::utils::default;

use super::gather::{GatherSettings, GiCamera};
use super::settings::{FrugalGi, GiVisibility};

/// Windows that there are pipelines for.
const WINDOWS: [u32; 3] = [2, 4, 8];
/// Window that joins the noise of rays where VPLs ask for none.
const RAY_WINDOW: u32 = 4;

/// Side of the window in gathered pixels; 1 is no filter. It holds every set of VPLs once.
pub(super) fn window(gi: &FrugalGi) -> u32 {
    let rays = if gi.visibility == GiVisibility::None { 1 } else { RAY_WINDOW };
    gi.interleave.side().max(rays)
}

/// Whether what the filter leaves of the noise of rays is joined over a wider window.
pub(super) fn smooths(gi: &FrugalGi) -> bool {
    gi.visibility != GiVisibility::None
}

#[derive(Resource)]
pub(super) struct FilterPipelines {
    layout: BindGroupLayoutDescriptor,
    pipelines: [CachedComputePipelineId; 3],
    smooth: CachedComputePipelineId,
}

impl FromWorld for FilterPipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/filter",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    uniform_buffer_sized(false, BufferSize::new(size_of::<GatherSettings>() as u64)),
                    texture_2d(TextureSampleType::Float { filterable: false }),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let shader = load_embedded_asset!(world, "filter.wgsl");
        let cache = world.resource::<PipelineCache>();
        let pipelines = WINDOWS.map(|window| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/filter/{window}").into()),
                layout: vec![layout.clone()],
                shader: shader.clone(),
                shader_defs: vec![ShaderDefVal::UInt("WINDOW".into(), window)],
                entry_point: Some("filter_gathered".into()),
                ..default()
            })
        });
        let smooth = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some("bevy_frugal_gi/filter/smooth".into()),
            layout: vec![layout.clone()],
            shader: load_embedded_asset!(world, "smooth.wgsl"),
            entry_point: Some("smooth_filtered".into()),
            ..default()
        });
        Self { layout, pipelines, smooth }
    }
}

/// In a GI camera's view: filters what was gathered.
pub(super) fn filter(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<FilterPipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    let Some(filtered) = camera.filtered.as_ref().filter(|_| camera.work.gather) else { return };
    let pipeline = WINDOWS.iter().position(|window| *window == camera.filter_window).map(|index| pipelines.pipelines[index]);
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        pipeline.and_then(|pipeline| cache.get_compute_pipeline(pipeline)),
    ) else {
        return;
    };
    let smooth = if camera.smooths { cache.get_compute_pipeline(pipelines.smooth) } else { None };
    // From what was gathered into the other texture, and back.
    let textures = [(&camera.irradiance, filtered), (filtered, &camera.irradiance)];
    let bind_groups = textures.map(|(from, to)| {
        context.render_device().create_bind_group(
            "bevy_frugal_gi/filter",
            &cache.get_bind_group_layout(&pipelines.layout),
            &BindGroupEntries::sequential((g_buffer, depth, views.clone(), camera.first_settings(), &from.default_view, &to.default_view)),
        )
    });
    let size = filtered.texture.size();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/filter");
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/filter"), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_groups[0], &[view_offset.offset]);
        pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
        if let Some(smooth) = smooth {
            pass.set_pipeline(smooth);
            pass.set_bind_group(0, &bind_groups[1], &[view_offset.offset]);
            pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
        }
    }
    span.end(context.command_encoder());
}

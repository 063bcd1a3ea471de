//! The filter: joins what neighbouring gathered pixels found with different VPLs and rays, and then
//! what was shown before.

mod history;

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
use super::settings::FrugalGi;
use history::Past;
pub(super) use history::{
    History, PastView, Step, bytes_of_texture, gathered_texture, size_of_texture,
};

/// Windows that there are pipelines for.
const WINDOWS: [u32; 3] = [2, 4, 8];
/// Window that joins the noise of rays where VPLs ask for none.
const RAY_WINDOW: u32 = 4;

/// Side of the window in gathered pixels; 1 is no filter. It holds every set of VPLs once.
pub(super) fn window(gi: &FrugalGi) -> u32 {
    let rays = if gi.visibility.rays() == 0 { 1 } else { RAY_WINDOW };
    gi.interleave.side().max(rays)
}

#[derive(Resource)]
pub(super) struct FilterPipelines {
    layout: BindGroupLayoutDescriptor,
    pipelines: [CachedComputePipelineId; 3],
    settle_layout: BindGroupLayoutDescriptor,
    /// Without the wider window, and with it.
    settle: [CachedComputePipelineId; 2],
}

impl FromWorld for FilterPipelines {
    fn from_world(world: &mut World) -> Self {
        let light = || texture_2d(TextureSampleType::Float { filterable: false });
        let settings =
            || uniform_buffer_sized(false, BufferSize::new(size_of::<GatherSettings>() as u64));
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/filter",
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
        let (shader, settle_shader) = (
            load_embedded_asset!(world, "filter.wgsl"),
            load_embedded_asset!(world, "settle.wgsl"),
        );
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
        let settle_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/filter/settle",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    settings(),
                    light(),
                    light(),
                    uniform_buffer_sized(false, BufferSize::new(size_of::<Past>() as u64)),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let settle = [vec![], vec!["SMOOTH".into()]].map(|shader_defs| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some("bevy_frugal_gi/filter/settle".into()),
                layout: vec![settle_layout.clone()],
                shader: settle_shader.clone(),
                shader_defs,
                entry_point: Some("settle".into()),
                ..default()
            })
        });
        Self { layout, pipelines, settle_layout, settle }
    }
}

/// In a GI camera's view: filters what was gathered, and lets what is shown follow it.
pub(super) fn filter(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<FilterPipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    let Some(history) =
        camera.history.as_ref().filter(|history| camera.work.gather || history.settles)
    else {
        return;
    };
    let pipeline = WINDOWS
        .iter()
        .position(|window| *window == camera.filter_window)
        .map(|index| pipelines.pipelines[index]);
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        pipeline.and_then(|pipeline| cache.get_compute_pipeline(pipeline)),
    ) else {
        return;
    };
    let device = context.render_device();
    let bind_group = device.create_bind_group(
        "bevy_frugal_gi/filter",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views.clone(),
            camera.first_settings(),
            &camera.irradiance.default_view,
            &history.filtered.default_view,
        )),
    );
    let smooths = camera.visibility.rays() > 0;
    let settle =
        cache.get_compute_pipeline(pipelines.settle[usize::from(smooths)]).map(|pipeline| {
            let entries = BindGroupEntries::sequential((
                g_buffer,
                depth,
                views,
                camera.first_settings(),
                &history.filtered.default_view,
                &history.texture.default_view,
                history.past.as_entire_binding(),
                &camera.irradiance.default_view,
            ));
            let layout = cache.get_bind_group_layout(&pipelines.settle_layout);
            (pipeline, device.create_bind_group("bevy_frugal_gi/filter/settle", &layout, &entries))
        });
    let size = history.filtered.texture.size();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/filter");
    {
        let mut pass = context.command_encoder().begin_compute_pass(&ComputePassDescriptor {
            label: Some("bevy_frugal_gi/filter"),
            timestamp_writes: None,
        });
        let (width, height) = (size.width.div_ceil(8), size.height.div_ceil(8));
        // What was filtered stays for as long as nothing moves.
        if camera.work.gather {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_group, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
        if let Some((pipeline, bind_group)) = &settle {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
    }
    span.end(context.command_encoder());
}

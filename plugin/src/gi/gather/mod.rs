//! The gather: irradiance from a camera's VPLs at a share of its pixels.

mod camera;
mod plan;
mod work;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

use super::settings::{FrugalGi, GiVisibility};
use super::visibility::OccluderBuffers;
use super::vpl::VPL_BYTES;
pub use camera::GiCamera;
use camera::first_of;
pub(super) use camera::prepare_cameras;
pub(super) use plan::{GatherSettings, VplPlan};

#[derive(Resource)]
pub(super) struct GatherPipelines {
    layout: BindGroupLayoutDescriptor,
    /// One for each way to see, in the order of [`GiVisibility::ALL`].
    pipelines: [CachedComputePipelineId; 3],
}

impl FromWorld for GatherPipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/gather",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    uniform_buffer_sized(true, BufferSize::new(u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES)),
                    uniform_buffer_sized(true, BufferSize::new(size_of::<GatherSettings>() as u64)),
                    storage_buffer_read_only_sized(false, None),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let occluders = OccluderBuffers::layout();
        let shader: Handle<Shader> = load_embedded_asset!(world, "gather.wgsl");
        let cache = world.resource::<PipelineCache>();
        let pipelines = GiVisibility::ALL.map(|visibility| {
            let rays = visibility.rays();
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/gather/{visibility:?}").into()),
                layout: if rays == 0 { vec![layout.clone()] } else { vec![layout.clone(), occluders.clone()] },
                shader: shader.clone(),
                shader_defs: if rays == 0 { vec![] } else { vec![ShaderDefVal::UInt("RAYS".into(), rays)] },
                entry_point: Some("gather_vpls".into()),
                ..default()
            })
        });
        Self { layout, pipelines }
    }
}

/// In a GI camera's view: gathers, set by set.
pub(super) fn gather(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    if !camera.work.gather {
        return;
    }
    let kind = GiVisibility::ALL.iter().position(|kind| *kind == camera.visibility).unwrap_or(0);
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        cache.get_compute_pipeline(pipelines.pipelines[kind]),
    ) else {
        return;
    };
    let traced = if camera.visibility == GiVisibility::None { None } else { occluders.bind_group() };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/gather",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views,
            first_of(&camera.vpls, u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES),
            camera.first_settings(),
            camera.plan_buffer.as_entire_binding(),
            &camera.irradiance.default_view,
        )),
    );
    let size = camera.irradiance.texture.size();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/gather");
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/gather"), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        if let Some(traced) = traced {
            pass.set_bind_group(1, traced, &[]);
        }
        let across = 8 * camera.plan.interleave;
        for set in 0..camera.plan.sets {
            let settings = set * plan::SETTINGS_STRIDE as u32;
            pass.set_bind_group(0, &bind_group, &[view_offset.offset, camera.plan.offset(set), settings]);
            pass.dispatch_workgroups(size.width.div_ceil(across), size.height.div_ceil(across), 1);
        }
    }
    span.end(context.command_encoder());
}

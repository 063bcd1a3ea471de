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
use super::sources::{SET_BYTES, SkyCamera};
use super::visibility::OccluderBuffers;
use super::vpl::VPL_BYTES;
pub use camera::GiCamera;
use camera::first_of;
pub(super) use camera::prepare_cameras;
pub(super) use plan::{GatherSettings, VplPlan};

/// One pipeline for each way to see, in the order of [`GiVisibility::ALL`], without a sky and with one.
#[derive(Resource)]
pub(super) struct GatherPipelines {
    layouts: [BindGroupLayoutDescriptor; 2],
    shader: Handle<Shader>,
    /// Without a sky they are there from the beginning, and with one once a camera has asked for it.
    pipelines: [[Option<CachedComputePipelineId>; 2]; 3],
}

impl FromWorld for GatherPipelines {
    fn from_world(world: &mut World) -> Self {
        let vpls = uniform_buffer_sized(true, BufferSize::new(u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES));
        let settings = uniform_buffer_sized(true, BufferSize::new(size_of::<GatherSettings>() as u64));
        let read = || storage_buffer_read_only_sized(false, None);
        let write = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        let (g_buffer, depth, view) = (texture_2d(TextureSampleType::Uint), texture_depth_2d(), uniform_buffer::<ViewUniform>(true));
        let sky = uniform_buffer_sized(true, BufferSize::new(SET_BYTES));
        let compute = ShaderStages::COMPUTE;
        let without_sky = BindGroupLayoutEntries::sequential(compute, (g_buffer, depth, view, vpls, settings, read(), write));
        let with_sky = BindGroupLayoutEntries::sequential(compute, (g_buffer, depth, view, vpls, settings, read(), write, sky, read()));
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
            pipelines.demand(cache, visibility, false);
        }
        pipelines
    }
}

impl GatherPipelines {
    /// The pipeline for a way to see; compiled from now on where it was not asked for before. A sky takes rays.
    pub(super) fn demand(&mut self, cache: &PipelineCache, visibility: GiVisibility, has_sky: bool) -> CachedComputePipelineId {
        let Self { layouts, shader, pipelines } = self;
        let kind = GiVisibility::ALL.iter().position(|kind| *kind == visibility).unwrap_or(0);
        *pipelines[kind][usize::from(has_sky)].get_or_insert_with(|| {
            let mut layout = vec![layouts[usize::from(has_sky)].clone()];
            let mut shader_defs = Vec::new();
            if visibility.rays() > 0 {
                layout.push(OccluderBuffers::layout());
                shader_defs.push(ShaderDefVal::UInt("RAYS".into(), visibility.rays()));
            }
            if has_sky {
                shader_defs.push(ShaderDefVal::UInt("SKY_RAYS".into(), visibility.sky_rays()));
            }
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/gather/{visibility:?}{}", if has_sky { "/sky" } else { "" }).into()),
                layout,
                shader: shader.clone(),
                shader_defs,
                entry_point: Some("gather_vpls".into()),
                ..default()
            })
        })
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
    let kind = GiVisibility::ALL.iter().position(|kind| *kind == camera.visibility).unwrap_or(0);
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        pipelines.pipelines[kind][usize::from(sky.is_some())].and_then(|pipeline| cache.get_compute_pipeline(pipeline)),
    ) else {
        return;
    };
    let traced = if camera.visibility == GiVisibility::None { None } else { occluders.bind_group() };
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
        Some(sky) => entries.extend_sequential((first_of(&sky.samples, SET_BYTES), sky.plan_buffer.as_entire_binding())),
        None => entries,
    };
    let layout = cache.get_bind_group_layout(&pipelines.layouts[usize::from(sky.is_some())]);
    let bind_group = context.render_device().create_bind_group("bevy_frugal_gi/gather", &layout, &entries);
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
            let offsets = [view_offset.offset, camera.plan.offset(set), settings, set * SET_BYTES as u32];
            pass.set_bind_group(0, &bind_group, &offsets[..if sky.is_some() { 4 } else { 3 }]);
            pass.dispatch_workgroups(size.width.div_ceil(across), size.height.div_ceil(across), 1);
        }
    }
    span.end(context.command_encoder());
}

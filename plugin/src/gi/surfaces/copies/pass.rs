//! The pass that averages textures for the CPU.

use bevy::app::App;
use bevy::asset::{Handle, embedded_asset, load_embedded_asset};
use bevy::core_pipeline::schedule::camera_driver;
use bevy::ecs::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    storage_buffer_sized, texture_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderGraph};
use bevy::render::storage::GpuShaderBuffer;
use bevy::render::texture::GpuImage;
use bevy::shader::Shader;
use bevy::utils::default;

use super::{CopyRequest, GiTextureCopies};
use crate::gi::compute::{bind_group, compute_pass};
use crate::gi::schedule::supported_render_app;

/// Threads along a side of a workgroup of `copy.wgsl`.
const GROUP: u32 = 8;

/// Its pipeline is queued with the first request.
#[derive(Resource)]
struct CopyPipeline {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    pipeline: Option<CachedComputePipelineId>,
}

impl FromWorld for CopyPipeline {
    fn from_world(world: &mut World) -> Self {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Float { filterable: false }),
                storage_buffer_sized(false, None),
                uniform_buffer_sized(false, None),
            ),
        );
        Self {
            layout: BindGroupLayoutDescriptor::new("bevy_frugal_gi/surfaces/copy", &entries),
            shader: load_embedded_asset!(world, "copy.wgsl"),
            pipeline: None,
        }
    }
}

pub(in crate::gi::surfaces) fn embed(app: &mut App) {
    embedded_asset!(app, "copy.wgsl");
}

pub(in crate::gi::surfaces) fn finish(app: &mut App) {
    let Some(render_app) = supported_render_app(app) else { return };
    render_app
        .init_gpu_resource::<CopyPipeline>()
        .add_systems(RenderGraph, copy.before(camera_driver));
    app.world_mut().resource_mut::<GiTextureCopies>().has_renderer = true;
}

/// Writes every requested copy whose texture is there.
fn copy(
    requests: Query<&CopyRequest>,
    mut pipeline: ResMut<CopyPipeline>,
    images: Res<RenderAssets<GpuImage>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    if requests.is_empty() {
        return;
    }
    let CopyPipeline { layout, shader, pipeline } = &mut *pipeline;
    let id = *pipeline.get_or_insert_with(|| {
        cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some("bevy_frugal_gi/surfaces/copy_texture".into()),
            layout: vec![layout.clone()],
            shader: shader.clone(),
            entry_point: Some("copy_texture".into()),
            ..default()
        })
    });
    let Some(pipeline) = cache.get_compute_pipeline(id) else { return };
    for request in &requests {
        let (Some(image), Some(buffer)) = (images.get(request.image), buffers.get(&request.buffer))
        else {
            continue;
        };
        let size = context.render_device().create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bevy_frugal_gi/surfaces/copy"),
            contents: bytemuck::cast_slice(&request.size.to_array()),
            usage: BufferUsages::UNIFORM,
        });
        let entries = BindGroupEntries::sequential((
            &image.texture_view,
            buffer.buffer.as_entire_binding(),
            size.as_entire_binding(),
        ));
        let bindings = bind_group(&context, &cache, layout, &entries);
        compute_pass(&mut context, "bevy_frugal_gi/copy", &[], |pass| {
            pass.set_bind_group(0, &bindings, &[]);
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(
                request.size.x.div_ceil(GROUP),
                request.size.y.div_ceil(GROUP),
                1,
            );
        });
    }
}

//! The pass that averages textures for the CPU.

use bevy::app::App;
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::schedule::camera_driver;
use bevy::ecs::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer_sized};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderGraph};
use bevy::render::storage::GpuShaderBuffer;
use bevy::render::texture::GpuImage;

use super::{CopyRequest, GiTextureCopies};
use crate::gi::compute::{Kernel, compute_pass, filled_buffer, write};
use crate::gi::schedule::supported_render_app;

/// Threads along a side of a workgroup of `copy.wgsl`.
const GROUP: u32 = 8;

/// Its pipeline is queued with the first request.
#[derive(Resource)]
struct CopyKernel(Kernel);

impl FromWorld for CopyKernel {
    fn from_world(world: &mut World) -> Self {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Float { filterable: false }),
                write(),
                uniform_buffer_sized(false, None),
            ),
        );
        let shader = load_embedded_asset!(world, "copy.wgsl");
        Self(Kernel::new("frugal_gi/surfaces/copy", "copy_texture", &shader, &entries))
    }
}

pub(in crate::gi::surfaces) fn embed(app: &mut App) {
    embedded_asset!(app, "copy.wgsl");
}

pub(in crate::gi::surfaces) fn finish(app: &mut App) {
    let Some(render_app) = supported_render_app(app) else { return };
    render_app
        .init_gpu_resource::<CopyKernel>()
        .add_systems(RenderGraph, copy.before(camera_driver));
    app.world_mut().resource_mut::<GiTextureCopies>().has_renderer = true;
}

/// Writes every requested copy whose texture is there.
fn copy(
    requests: Query<&CopyRequest>,
    mut kernel: ResMut<CopyKernel>,
    images: Res<RenderAssets<GpuImage>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    if requests.is_empty() {
        return;
    }
    kernel.0.queue(&cache, Vec::new());
    let Some(pipeline) = kernel.0.get(&cache, &[]) else { return };
    for request in &requests {
        let (Some(image), Some(buffer)) = (images.get(request.image), buffers.get(&request.buffer))
        else {
            continue;
        };
        let size = filled_buffer(
            context.render_device(),
            "frugal_gi/surfaces/copy",
            bytemuck::cast_slice(&request.size.to_array()),
            BufferUsages::UNIFORM,
        );
        let entries = BindGroupEntries::sequential((
            &image.texture_view,
            buffer.buffer.as_entire_binding(),
            size.as_entire_binding(),
        ));
        let bindings = kernel.0.bind(&context, &cache, &entries);
        compute_pass(&mut context, "frugal_gi/copy", &[], |pass| {
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

//! Read-back of images from the GPU.

use std::fmt::Display;

use bevy::asset::Handle;
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType,
    TexelCopyBufferInfo, TexelCopyBufferLayout, Texture,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use frugal_trace::metrics::{Picture, Radiance};
use half::f16;

use super::StageError;

pub(super) fn picture(world: &World, target: &Handle<Image>) -> Result<Picture, StageError> {
    let (texture, rows) = read(world, target, 4)?;
    let rgb = rows.chunks_exact(4).map(|texel| [texel[0], texel[1], texel[2]]).collect();
    Picture::new(texture.0, texture.1, rgb).map_err(fail)
}

pub(super) fn radiance(
    world: &World,
    target: &Handle<Image>,
    exposure: f32,
) -> Result<Radiance, StageError> {
    let ((width, height), rows) = read(world, target, 8)?;
    let channel = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32() / exposure;
    let rgb = rows
        .chunks_exact(8)
        .map(|texel| [channel(&texel[0..2]), channel(&texel[2..4]), channel(&texel[4..6])])
        .collect();
    Ok(Radiance { width, height, rgb })
}

fn fail(problem: impl Display) -> StageError {
    StageError::failed(format!("the image could not be read back: {problem}"))
}

/// Size of the target, and its texels without row padding.
fn read(
    world: &World,
    target: &Handle<Image>,
    texel_bytes: u32,
) -> Result<((u32, u32), Vec<u8>), StageError> {
    let image = world
        .resource::<RenderAssets<GpuImage>>()
        .get(target)
        .ok_or_else(|| fail("there is no image yet"))?;
    let texture: &Texture = &image.texture;
    let bytes_of_format =
        texture.format().block_copy_size(None).ok_or_else(|| fail("an unreadable format"))?;
    if bytes_of_format != texel_bytes {
        return Err(fail("the stage was opened for another kind of image"));
    }
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let size = texture.size();
    let row = size.width * texel_bytes;
    let padded = RenderDevice::align_copy_bytes_per_row(row as usize) as u32;
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("frugal/stage/read_back"),
        size: u64::from(padded) * u64::from(size.height),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("frugal/stage/read_back"),
    });
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        TexelCopyBufferInfo {
            buffer: &buffer,
            layout: TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        size,
    );
    queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    let slice = buffer.slice(..);
    slice.map_async(MapMode::Read, move |result| drop(sender.send(result)));
    device.poll(PollType::wait_indefinitely()).map_err(fail)?;
    receiver.recv().map_err(fail)?.map_err(fail)?;
    let mapped = slice.get_mapped_range();
    let texels = mapped
        .chunks_exact(padded as usize)
        .flat_map(|padded| &padded[..row as usize])
        .copied()
        .collect();
    Ok(((size.width, size.height), texels))
}

//! A synthetic G-buffer for the shipped kernels that read one.

use bevy::math::{DVec3, Vec3};
use bevy::render::render_resource::{
    Buffer, CommandEncoderDescriptor, Extent3d, LoadOp, Operations,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, StoreOp, TexelCopyBufferLayout,
    Texture, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use frugal::stage::Stage;

use crate::{gpu, kernel};

/// World positions of pixels: their centres are `spacing` apart around `center`, columns along x
/// and rows along −z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// World space, metres.
    pub center: Vec3,
    /// Distance between pixel centres, metres.
    pub spacing: f32,
    /// The eye, world space, metres.
    pub eye: Vec3,
    /// Factor on radiance.
    pub exposure: f32,
}

impl Plane {
    /// Pixels 1 m apart around the origin, with the eye at the origin.
    pub const ORIGIN: Self =
        Self { center: Vec3::ZERO, spacing: 1.0, eye: Vec3::ZERO, exposure: 0.01 };

    /// Distance at which a lens of 45 degrees shows things as large as an image of `height` rows
    /// shows them, metres.
    pub fn apparent_distance(&self, height: u32) -> f64 {
        (1.0 + 2f64.sqrt()) * f64::from(height) / 2.0 * f64::from(self.spacing)
    }

    /// Centre of pixel (x, y) of an image of `width` × `height`, world space, metres.
    pub fn position(&self, [width, height]: [u32; 2], x: u32, y: u32) -> DVec3 {
        let offset = |at: u32, size: u32| {
            (f64::from(at) + 0.5 - f64::from(size) / 2.0) * f64::from(self.spacing)
        };
        // Rows run down, clip space runs up.
        self.center.as_dvec3() + DVec3::new(offset(x, width), 0.0, -offset(y, height))
    }
}

/// A G-buffer and depth.
pub struct Pixels {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Bevy's deferred G-buffer.
    pub g_buffer: TextureView,
    /// 0.5 everywhere, or 0 where there is no surface.
    pub depth: TextureView,
}

impl Pixels {
    /// A G-buffer with packed normals, row by row, at depth 0.5.
    pub fn new(stage: &Stage, size: [u32; 2], normals: &[u32]) -> Self {
        Self::with_depth(stage, size, normals, 0.5)
    }

    /// [`new`](Self::new) with another depth: 0 for no surface anywhere.
    pub fn with_depth(stage: &Stage, size: [u32; 2], normals: &[u32], depth: f32) -> Self {
        let texels: Vec<[u32; 4]> = normals.iter().map(|normal| [0, 0, 0, *normal]).collect();
        Self::with_texels(stage, size, &texels, depth)
    }

    /// A G-buffer of texels as Bevy packs them.
    pub fn with_texels(stage: &Stage, size: [u32; 2], texels: &[[u32; 4]], depth: f32) -> Self {
        let g_buffer = texture(
            stage,
            size,
            TextureFormat::Rgba32Uint,
            TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        );
        write(
            stage,
            &g_buffer,
            &texels.iter().flatten().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>(),
        );
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT;
        let view = texture(stage, size, TextureFormat::Depth32Float, usage)
            .create_view(&Default::default());
        let (device, queue) = (
            stage.render_world().resource::<RenderDevice>(),
            stage.render_world().resource::<RenderQueue>(),
        );
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("frugal_tests/depth"),
        });
        encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("frugal_tests/depth"),
            color_attachments: &[],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &view,
                depth_ops: Some(Operations { load: LoadOp::Clear(depth), store: StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        queue.submit([encoder.finish()]);
        Self { size, g_buffer: g_buffer.create_view(&Default::default()), depth: view }
    }

    /// Bevy's view uniform, of which the kernels read `world_from_clip` (the third matrix), the z
    /// axis of the eye, opposite to the viewing direction (in the fourth: here up), the eye and the
    /// exposure (after seven matrices), and the viewport, which fills the image.
    pub fn view(&self, stage: &Stage, plane: &Plane) -> Buffer {
        let mut words = vec![0.0f32; 256];
        let [width, height] = self.size.map(|size| size as f32 / 2.0 * plane.spacing);
        let Vec3 { x, y, z } = plane.center;
        words[32..48].copy_from_slice(&[
            width, 0.0, 0.0, 0.0, 0.0, 0.0, height, 0.0, 0.0, 0.0, 0.0, 0.0, x, y, z, 1.0,
        ]);
        words[57] = 1.0;
        // Orthographic: the width of a pixel does not depend on the distance.
        (words[85], words[95]) = (1.0 / height, 1.0);
        words[112..115].copy_from_slice(&plane.eye.to_array());
        words[115] = plane.exposure;
        (words[118], words[119]) = (self.size[0] as f32, self.size[1] as f32);
        kernel::buffer(stage, &gpu::bytes(&words))
    }

    /// A texture of half floats of the same size, for a kernel to write.
    pub fn output(&self, stage: &Stage) -> Texture {
        texture(stage, self.size, TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING)
    }

    /// A texture of half floats of the same size with contents, for a kernel to read.
    pub fn input(&self, stage: &Stage, halves: &[[u16; 4]]) -> TextureView {
        let texture = texture(
            stage,
            self.size,
            TextureFormat::Rgba16Float,
            TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        );
        write(
            stage,
            &texture,
            &halves.iter().flatten().flat_map(|half| half.to_le_bytes()).collect::<Vec<_>>(),
        );
        texture.create_view(&Default::default())
    }

    /// A texture of floats of the same size with contents, for a kernel to read.
    pub fn float_input(&self, stage: &Stage, floats: &[f32]) -> TextureView {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let texture = texture(stage, self.size, TextureFormat::R32Float, usage);
        write(stage, &texture, &gpu::bytes(floats));
        texture.create_view(&Default::default())
    }

    /// A texture of floats of the same size, for a kernel to write and the CPU to read.
    pub fn float_output(&self, stage: &Stage) -> Texture {
        texture(stage, self.size, TextureFormat::R32Float, TextureUsages::STORAGE_BINDING)
    }
}

fn texture(
    stage: &Stage,
    [width, height]: [u32; 2],
    format: TextureFormat,
    usage: TextureUsages,
) -> Texture {
    stage.render_world().resource::<RenderDevice>().create_texture(&TextureDescriptor {
        label: Some("frugal_tests/texture"),
        size: Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: usage | TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn write(stage: &Stage, texture: &Texture, bytes: &[u8]) {
    let row = bytes.len() as u32 / texture.height();
    let layout =
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    stage.render_world().resource::<RenderQueue>().write_texture(
        texture.as_image_copy(),
        bytes,
        layout,
        texture.size(),
    );
}

/// A normal packed as in the G-buffer (octahedral coordinates, 12 bits each), and its value after
/// unpacking.
pub fn g_buffer_normal(normal: Vec3) -> (u32, DVec3) {
    let normal = normal.as_dvec3() / f64::from(normal.abs().element_sum());
    let wrap = |own: f64, other: f64| (1.0 - other.abs()) * if own > 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if normal.z >= 0.0 {
        (normal.x, normal.y)
    } else {
        (wrap(normal.x, normal.y), wrap(normal.y, normal.x))
    };
    let [x, y] = [x, y].map(|value| ((value * 0.5 + 0.5).clamp(0.0, 1.0) * 4095.0).round() as u32);
    let [fx, fy] = [x, y].map(|bits| f64::from(bits) / 4095.0 * 2.0 - 1.0);
    let z = 1.0 - fx.abs() - fy.abs();
    let fold = (-z).clamp(0.0, 1.0);
    let [nx, ny] = [fx, fy].map(|f| if f >= 0.0 { f - fold } else { f + fold });
    (x | y << 12, DVec3::new(nx, ny, z).normalize())
}

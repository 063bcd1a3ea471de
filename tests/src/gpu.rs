//! Reads buffers and textures back from the GPU.

use bevy::ecs::world::World;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType,
    TexelCopyBufferInfo, TexelCopyBufferLayout, Texture,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_frugal_gi::gi::inspect;
use frugal::stage::Stage;
use half::f16;

/// A point of light on a surface: a texel of a reflective shadow map, or a virtual point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World space, metres.
    pub position: [f32; 3],
    /// World space, unit length.
    pub normal: [f32; 3],
    /// Lumens.
    pub flux: [f32; 3],
    /// Of a texel: its surface area, m². Of a virtual point light: the upper bound of its geometry
    /// term, 1/m².
    pub extent: f32,
}

impl Point {
    /// 32-bit words of a virtual point light in a buffer.
    pub const VPL_WORDS: usize = 12;

    /// 32-bit words of a texel in a buffer.
    pub const TEXEL_WORDS: usize = 8;

    /// Buffer layout of a virtual point light that seems visible everywhere.
    pub fn to_vpl(self) -> [f32; Self::VPL_WORDS] {
        let ([px, py, pz], [nx, ny, nz], [r, g, b]) = (self.position, self.normal, self.flux);
        [px, py, pz, self.extent, nx, ny, nz, 0.0, r, g, b, 1.0]
    }

    /// Buffer layout of a texel: its normal in octahedral coordinates of 16 bits each.
    pub fn to_texel(self) -> [f32; Self::TEXEL_WORDS] {
        let ([px, py, pz], [r, g, b]) = (self.position, self.flux);
        [px, py, pz, self.extent, r, g, b, f32::from_bits(pack_normal(self.normal))]
    }

    fn from_vpl(words: &[f32]) -> Self {
        let three = |at: usize| [words[at], words[at + 1], words[at + 2]];
        Self { position: three(0), extent: words[3], normal: three(4), flux: three(8) }
    }

    fn from_texel(words: &[f32]) -> Self {
        let three = |at: usize| [words[at], words[at + 1], words[at + 2]];
        Self {
            position: three(0),
            extent: words[3],
            flux: three(4),
            normal: unpack_normal(words[7].to_bits()),
        }
    }

    /// Rec. 709 luminance of the flux.
    pub fn luminance(&self) -> f64 {
        self.flux
            .iter()
            .zip([0.2126, 0.7152, 0.0722])
            .map(|(flux, weight)| f64::from(*flux) * weight)
            .sum()
    }
}

/// Octahedral coordinates (Cigolle et al. 2014), 16 bits each: `pack_normal` of `texels/texels.wgsl` on
/// the CPU.
pub fn pack_normal([x, y, z]: [f32; 3]) -> u32 {
    let length = x.abs() + y.abs() + z.abs();
    let (x, y, z) = (x / length, y / length, z / length);
    let wrap = |own: f32, other: f32| (1.0 - other.abs()) * if own > 0.0 { 1.0 } else { -1.0 };
    let (x, y) = if z >= 0.0 { (x, y) } else { (wrap(x, y), wrap(y, x)) };
    let bits = |value: f32| ((value * 0.5 + 0.5).clamp(0.0, 1.0) * 65535.0).round() as u32;
    bits(x) | bits(y) << 16
}

/// The inverse of [`pack_normal`], a unit vector.
pub fn unpack_normal(packed: u32) -> [f32; 3] {
    let [x, y] = [packed & 0xFFFF, packed >> 16].map(|bits| bits as f32 / 65535.0 * 2.0 - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).clamp(0.0, 1.0);
    let [x, y] = [x, y].map(|value| if value >= 0.0 { value - fold } else { value + fold });
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// Bytes of a table of `Row`s: `count` consecutive ones of `length` texels each, of which each has
/// tiles of its own and its whole flux.
pub fn row_table(count: u32, length: u32) -> Vec<u8> {
    let share = 1f32.to_bits();
    let row = |row| [row * length, row * length, length, 0, 0, 1, 0, 0, share, 0];
    (0..count).flat_map(row).flat_map(u32::to_le_bytes).collect()
}

/// Sum of the flux over all points, by channel, lumens.
pub fn total_flux(points: &[Point]) -> [f64; 3] {
    [0, 1, 2].map(|channel| points.iter().map(|point| f64::from(point.flux[channel])).sum())
}

/// Every texel of every reflective shadow map of the last frame.
pub fn rsm_texels(stage: &Stage) -> Vec<Point> {
    let state = inspect::gpu_state(stage.render_world());
    state.texels.map_or_else(Vec::new, |buffer| texels(&read_buffer(stage.render_world(), &buffer)))
}

/// The virtual point lights of the first camera that gathers. Their fluxes are divided by the
/// number of sets, so that they add up to the total.
pub fn vpls(stage: &Stage) -> Vec<Point> {
    let state = inspect::gpu_state(stage.render_world());
    let Some(camera) = state.cameras.first() else { return Vec::new() };
    let slots = vpl_slots(&read_buffer(stage.render_world(), &camera.vpls));
    let members = slots.iter().take((camera.sets * camera.per_set) as usize);
    // Each set alone carries the total flux.
    let share = |flux: f32| flux / camera.sets as f32;
    members.map(|vpl| Point { flux: vpl.flux.map(share), ..*vpl }).collect()
}

/// Parses the bytes of a buffer of virtual point lights.
pub fn vpl_slots(bytes: &[u8]) -> Vec<Point> {
    floats(bytes).chunks_exact(Point::VPL_WORDS).map(Point::from_vpl).collect()
}

/// Parses the bytes of a buffer of texels.
pub fn texels(bytes: &[u8]) -> Vec<Point> {
    floats(bytes).chunks_exact(Point::TEXEL_WORDS).map(Point::from_texel).collect()
}

/// Parses little-endian 32-bit floats.
pub fn floats(bytes: &[u8]) -> Vec<f32> {
    words(bytes).into_iter().map(f32::from_bits).collect()
}

/// Parses little-endian 32-bit words.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
}

/// Little-endian bytes of 32-bit floats.
pub fn bytes(floats: &[f32]) -> Vec<u8> {
    floats.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Value of a half float.
pub fn half(bits: u16) -> f64 {
    f16::from_bits(bits).to_f64()
}

fn mapped(world: &World, buffer: &Buffer) -> Vec<u8> {
    let slice = buffer.slice(..);
    slice.map_async(MapMode::Read, |result| {
        result.unwrap_or_else(|error| panic!("a buffer cannot be read back: {error}"));
    });
    world
        .resource::<RenderDevice>()
        .poll(PollType::wait_indefinitely())
        .unwrap_or_else(|error| panic!("{error}"));
    slice.get_mapped_range().to_vec()
}

fn staging_buffer(device: &RenderDevice, size: u64) -> Buffer {
    let usage = BufferUsages::COPY_DST | BufferUsages::MAP_READ;
    device.create_buffer(&BufferDescriptor {
        label: Some("frugal_tests/read_back"),
        size,
        usage,
        mapped_at_creation: false,
    })
}

/// Bytes of a buffer.
pub fn read_buffer(world: &World, buffer: &Buffer) -> Vec<u8> {
    let device = world.resource::<RenderDevice>();
    let staging_buffer = staging_buffer(device, buffer.size());
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("frugal_tests/read_back"),
    });
    encoder.copy_buffer_to_buffer(buffer, 0, &staging_buffer, 0, buffer.size());
    world.resource::<RenderQueue>().submit([encoder.finish()]);
    mapped(world, &staging_buffer)
}

/// Texels of a two-dimensional texture of four half floats, row by row.
pub fn read_halves(world: &World, texture: &Texture) -> Vec<[f64; 4]> {
    let device = world.resource::<RenderDevice>();
    let (size, row) = (texture.size(), texture.size().width * 8);
    let padded = row.next_multiple_of(256);
    let staging_buffer = staging_buffer(device, u64::from(padded) * u64::from(size.height));
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
        label: Some("frugal_tests/read_back"),
    });
    let layout =
        TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &staging_buffer, layout },
        size,
    );
    world.resource::<RenderQueue>().submit([encoder.finish()]);
    let bytes = mapped(world, &staging_buffer);
    let texels = bytes
        .chunks_exact(padded as usize)
        .flat_map(|line| line[..row as usize].as_chunks::<8>().0);
    texels
        .map(|texel| [0, 2, 4, 6].map(|at| half(u16::from_le_bytes([texel[at], texel[at + 1]]))))
        .collect()
}

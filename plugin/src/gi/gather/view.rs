//! A GI camera's buffers for the gather.

use bevy::ecs::prelude::*;
use bevy::math::UVec2;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::CachedTexture;
use bytemuck::{Pod, Zeroable};

use crate::gi::compute::filled_buffer;
use crate::gi::settings::GiPixelFraction;
use crate::gi::view::GiView;
use crate::gi::vpl::VplView;

/// Label of irradiance textures.
const IRRADIANCE: &str = "frugal_gi/gather/irradiance";

/// The irradiance of a GI camera. In the render world.
#[derive(Component)]
pub(in crate::gi) struct GatherView {
    /// Irradiance of each low-resolution pixel: as gathered, and then denoised where there is a
    /// filter.
    pub irradiance: CachedTexture,
    /// That of the frame before, of views that filter. It may have another resolution.
    pub previous: Option<CachedTexture>,
    pub settings: Buffer,
    /// The pixel fraction that `settings` is for.
    made_for: GiPixelFraction,
}

impl GatherView {
    fn new(device: &RenderDevice, view: &GiView) -> Self {
        let fraction = view.gi.pixel_fraction;
        Self {
            irradiance: irradiance_texture(device, IRRADIANCE, view.cells()),
            previous: None,
            settings: filled_buffer(
                device,
                "frugal_gi/gather/settings",
                bytemuck::bytes_of(&GatherSettings::new(fraction)),
                BufferUsages::UNIFORM,
            ),
            made_for: fraction,
        }
    }

    /// Makes the irradiance [`previous`](Self::previous), and the other texture the one to gather
    /// into.
    pub(crate) fn swap(&mut self, device: &RenderDevice, cells: UVec2) {
        let other = self.previous.take().filter(|texture| texture_size(texture) == cells);
        let other = other.unwrap_or_else(|| irradiance_texture(device, IRRADIANCE, cells));
        self.previous = Some(std::mem::replace(&mut self.irradiance, other));
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        texture_bytes(&self.irradiance)
            + self.previous.as_ref().map_or(0, texture_bytes)
            + self.settings.size()
    }
}

/// `gather/gather.wgsl`'s `Gather`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct GatherSettings {
    pub cell_width: u32,
    pub cell_height: u32,
    padding: [u32; 2],
}

impl GatherSettings {
    fn new(fraction: GiPixelFraction) -> Self {
        let (cell_width, cell_height) = fraction.cell();
        Self { cell_width, cell_height, padding: [0; 2] }
    }
}

/// A texture of irradiance at low resolution.
pub(in crate::gi) fn irradiance_texture(
    device: &RenderDevice,
    label: &'static str,
    cells: UVec2,
) -> CachedTexture {
    low_resolution_texture(device, label, cells, TextureFormat::Rgba16Float)
}

/// A texture with a texel for each low-resolution pixel. Not from Bevy's cache, whose textures may
/// go to another camera in the next frame: what it holds must persist.
pub(in crate::gi) fn low_resolution_texture(
    device: &RenderDevice,
    label: &'static str,
    cells: UVec2,
    format: TextureFormat,
) -> CachedTexture {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: cells.x, height: cells.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::STORAGE_BINDING
            | TextureUsages::TEXTURE_BINDING
            | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let default_view = texture.create_view(&TextureViewDescriptor::default());
    CachedTexture { texture, default_view }
}

/// Pixels along both axes.
pub(in crate::gi) fn texture_size(texture: &CachedTexture) -> UVec2 {
    UVec2::new(texture.texture.width(), texture.texture.height())
}

/// Bytes of a [`low_resolution_texture`].
pub(in crate::gi) fn texture_bytes(texture: &CachedTexture) -> u64 {
    let size = texture_size(texture).as_u64vec2();
    let texel = texture.texture.format().block_copy_size(None).unwrap_or(0);
    size.x * size.y * u64::from(texel)
}

/// Gives every view its irradiance texture and its settings.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<(Entity, &GiView, Option<&mut GatherView>), With<VplView>>,
) {
    for (entity, view, held) in &mut views {
        let Some(mut held) = held else {
            commands.entity(entity).insert(GatherView::new(&device, view));
            continue;
        };
        let fraction = view.gi.pixel_fraction;
        if held.made_for != fraction {
            let settings = GatherSettings::new(fraction);
            queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&settings));
        }
        held.made_for = fraction;
        // Those that filter swap textures when their history advances.
        if !view.gi.filters() {
            held.previous = None;
            if texture_size(&held.irradiance) != view.cells() {
                held.irradiance = irradiance_texture(&device, IRRADIANCE, view.cells());
            }
        }
    }
}

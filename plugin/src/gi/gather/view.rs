//! A GI camera's buffers for the gather.

use bevy::ecs::prelude::*;
use bevy::math::UVec2;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::CachedTexture;

use super::settings::{GatherSettings, settings_bytes};
use crate::gi::settings::GiPixelFraction;
use crate::gi::view::GiView;
use crate::gi::vpl::VplView;

/// The irradiance of a GI camera. In the render world.
#[derive(Component)]
pub(in crate::gi) struct GatherView {
    /// Irradiance of each low-resolution pixel: as gathered, and then denoised where there is a
    /// filter.
    pub irradiance: CachedTexture,
    /// The irradiance of the last frame, if it had another resolution.
    pub replaced: Option<CachedTexture>,
    settings: Buffer,
    /// The number of sets and the pixel fraction that `settings` is for.
    made_for: (u32, GiPixelFraction),
}

impl GatherView {
    /// The settings of the first set, to which a dynamic offset may be added.
    pub(crate) fn first_settings(&self) -> BindingResource<'_> {
        super::first_of(&self.settings, size_of::<GatherSettings>() as u64)
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        texture_bytes(&self.irradiance) + self.settings.size()
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

/// Label of [`GatherView::irradiance`].
pub(in crate::gi) const IRRADIANCE: &str = "bevy_frugal_gi/gather/irradiance";

/// Gives every view its irradiance texture and its dispatches' settings.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    views: Query<(Entity, &GiView, &VplView)>,
    mut held: Query<&mut GatherView>,
    stale: Query<Entity, (With<GatherView>, Without<GiView>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<GatherView>();
    }
    for (entity, view, vpl_view) in &views {
        let fraction = view.gi.pixel_fraction;
        let made_for = (vpl_view.plan.sets, fraction);
        let settings = || {
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("bevy_frugal_gi/gather/settings"),
                contents: &settings_bytes(&vpl_view.plan, fraction),
                usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            })
        };
        let Ok(mut held) = held.get_mut(entity) else {
            commands.entity(entity).insert(GatherView {
                irradiance: irradiance_texture(&device, IRRADIANCE, view.cells()),
                replaced: None,
                settings: settings(),
                made_for,
            });
            continue;
        };
        if held.made_for.0 != made_for.0 {
            held.settings = settings();
        } else if held.made_for.1 != made_for.1 {
            queue.write_buffer(&held.settings, 0, &settings_bytes(&vpl_view.plan, fraction));
        }
        held.made_for = made_for;
        held.replaced = None;
        if texture_size(&held.irradiance) != view.cells() {
            let new = irradiance_texture(&device, IRRADIANCE, view.cells());
            held.replaced = Some(std::mem::replace(&mut held.irradiance, new));
        }
    }
}

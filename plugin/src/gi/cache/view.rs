//! A GI camera's cache: its buffers, and what happens to it in a frame.

use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::CachedTexture;
use bytemuck::{Pod, Zeroable};

use crate::cut::Jumps;
use crate::gi::compute::{bytes_of, empty_buffer, filled_buffer};
use crate::gi::gather::{low_resolution_texture, texture_bytes, texture_size};
use crate::gi::view::{GiFrame, GiView};
use crate::gi::vpl::VplView;

/// Slots of the table: a power of two. A view of 70 degrees has 20,000 to 40,000 cells.
pub(super) const SLOTS: u32 = 1 << 17;
/// Bytes of `cache/table.wgsl`'s `Cell`. A test compares it with the shader.
pub(in crate::gi) const CELL_BYTES: u64 = 24;
/// Counters behind the keys.
const COUNTERS: u64 = 4;
/// Most samples of a frame. Higher values: light settles sooner after a cut, for more rays.
const MAX_SAMPLES: u32 = 4096;
/// Least side of a tile, pixels: where an image is small, samples fall with its pixels.
const MIN_TILE: u32 = 8;
/// Frames for which older light fades after a change, by a quarter in each.
const FADE_FRAMES: u32 = 28;
/// Frames from one search for cells that are out of view to the next.
const AGE_PERIOD: u32 = 64;
/// Frames after which a cache in a still scene hardly changes.
const SETTLED_FRAMES: u32 = 64;

/// `cache/table.wgsl`'s `Settings`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct CacheSettings {
    origin: [f32; 3],
    frame: u32,
    tile: u32,
    tiles: [u32; 2],
    cell: [u32; 2],
    exposure: f32,
    fades: u32,
    padding: u32,
}

/// The cache of a GI camera. In the render world.
#[derive(Component)]
pub(in crate::gi) struct CacheView {
    /// Keys of all slots, then counters.
    pub keys: Buffer,
    pub cells: Buffer,
    pub(super) settings_buffer: Buffer,
    /// What is sampled in each tile, and its light.
    pub(super) records: CachedTexture,
    pub(super) light: CachedTexture,
    settings: CacheSettings,
    /// The exposure of its light.
    exposure: f32,
    /// Frames for which older light still fades.
    fading: u32,
    /// Whether it begins anew in this frame.
    pub(super) begins: bool,
    /// Whether cells age in this frame.
    pub(super) ages: bool,
}

/// Side of a tile in pixels, and tiles along both axes, for an image.
fn tiles(size: UVec2) -> (u32, UVec2) {
    let pixels = u64::from(size.x) * u64::from(size.y);
    let mut side = ((pixels as f64 / f64::from(MAX_SAMPLES)).sqrt() as u32).max(MIN_TILE);
    let count = |side: u32| UVec2::new(size.x.div_ceil(side), size.y.div_ceil(side));
    while count(side).element_product() > MAX_SAMPLES {
        side += 1;
    }
    (side, count(side))
}

/// Samples that a view's cache takes in a frame, at most.
pub(in crate::gi) fn samples(view: &GiView) -> u64 {
    u64::from(tiles(view.camera.size).1.element_product())
}

impl CacheView {
    fn new(device: &RenderDevice, view: &GiView) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let slots = u64::from(SLOTS);
        let [records, light] = textures(device, tiles(view.camera.size).1);
        let settings = CacheSettings::zeroed();
        Self {
            keys: empty_buffer(device, "frugal_gi/cache/keys", (slots + COUNTERS) * 4, usage),
            cells: empty_buffer(device, "frugal_gi/cache/cells", slots * CELL_BYTES, usage),
            settings_buffer: filled_buffer(
                device,
                "frugal_gi/cache/settings",
                bytemuck::bytes_of(&settings),
                BufferUsages::STORAGE,
            ),
            records,
            light,
            settings,
            exposure: view.camera.exposure,
            fading: 0,
            begins: true,
            ages: false,
        }
    }

    /// Prepares the cache for a frame in which it is gathered.
    fn advance(
        &mut self,
        view: &GiView,
        frame: &GiFrame,
        shift: Option<Vec3>,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) {
        let exposure = view.camera.exposure / self.exposure;
        self.exposure = view.camera.exposure;
        // Whole numbers hold no light of an exposure that is another altogether.
        let is_exposed = (1e-3..1e3).contains(&exposure);
        self.begins = view.is_new || !is_exposed;
        if self.begins {
            (self.settings.frame, self.fading) = (0, 0);
            self.settings.origin = [0.0; 3];
        }
        if let Some(shift) = shift.filter(|_| !self.begins) {
            self.settings.origin = (Vec3::from_array(self.settings.origin) + shift).to_array();
        }
        self.fading =
            if frame.gather || view.relit { FADE_FRAMES } else { self.fading.saturating_sub(1) };
        let (tile, tiles) = tiles(view.camera.size);
        if texture_size(&self.records) != tiles {
            [self.records, self.light] = textures(device, tiles);
        }
        self.settings = CacheSettings {
            frame: self.settings.frame + 1,
            tile,
            tiles: tiles.to_array(),
            cell: view.camera.cell.to_array(),
            exposure: if is_exposed { exposure } else { 1.0 },
            fades: u32::from(self.fading > 0),
            ..self.settings
        };
        self.ages = !self.begins
            && (self.fading > 0
                || self.settings.exposure != 1.0
                || self.settings.frame.is_multiple_of(AGE_PERIOD));
        queue.write_buffer(&self.settings_buffer, 0, bytemuck::bytes_of(&self.settings));
    }

    /// Whether its light still changes although nothing moves.
    pub(crate) fn is_settling(&self) -> bool {
        self.fading > 0 || self.settings.frame < SETTLED_FRAMES
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        bytes_of([&self.keys, &self.cells, &self.settings_buffer])
            + texture_bytes(&self.records)
            + texture_bytes(&self.light)
    }
}

/// Textures with a texel for each tile: records, and light.
fn textures(device: &RenderDevice, tiles: UVec2) -> [CachedTexture; 2] {
    [
        ("frugal_gi/cache/records", TextureFormat::Rg32Uint),
        ("frugal_gi/cache/light", TextureFormat::Rgba32Float),
    ]
    .map(|(label, format)| low_resolution_texture(device, label, tiles, format))
}

/// Gives every view that has a cache its buffers, and takes them from the others.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    (frame, jumps): (Res<GiFrame>, Res<Jumps>),
    mut views: Query<(Entity, &MainEntity, &GiView, Option<&mut CacheView>), With<VplView>>,
) {
    for (entity, main_entity, view, held) in &mut views {
        let shift = jumps.shifts.get(&main_entity.id()).copied();
        match held {
            Some(_) if !view.gi.caches() => {
                commands.entity(entity).remove::<CacheView>();
            }
            Some(mut cache) if view.work.gather => {
                cache.advance(view, &frame, shift, &device, &queue);
            }
            None if view.gi.caches() => {
                let mut cache = CacheView::new(&device, view);
                cache.advance(view, &frame, None, &device, &queue);
                commands.entity(entity).insert(cache);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_takes_no_more_samples_at_any_size() {
        for size in
            [(1_u32, 1_u32), (64, 64), (65, 64), (640, 360), (1920, 1080), (7680, 4320), (9000, 1)]
        {
            let size = UVec2::from(size);
            let (side, tiles) = tiles(size);
            assert!(tiles.element_product() <= MAX_SAMPLES, "{size}: {tiles}");
            assert!((tiles * side).cmpge(size).all() && ((tiles - 1) * side).cmplt(size).all());
            let pixels = f64::from(size.element_product());
            let least = f64::from(MAX_SAMPLES).min(pixels / 64.0) / 2.0;
            assert!(size.min_element() == 1 || f64::from(tiles.element_product()) > least);
        }
    }
}

//! A reflective shadow map: its camera, its data, both of one that should exist, and room for its
//! texels: how many the device can hold, and where each map's lie in the store.

use std::collections::BTreeMap;
use std::ops::Range;

use bevy::camera::Projection;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryItem;
use bevy::log::warn_once;
use bevy::reflect::Reflect;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::settings::WgpuLimits;
use bevy::render::sync_component::SyncComponent;
use bevy::transform::components::{GlobalTransform, Transform};
use range_alloc::RangeAllocator;

use super::lights::RsmLight;
use crate::gi::compute::largest_storage_buffer;
use crate::gi::settings::GiShading;
use crate::gi::texels::{CascadeCut, TEXEL_BYTES};

/// Marks a hidden camera that renders a light's reflective shadow map. Filter camera queries by
/// `Without<RsmView>` where they mean visible cameras.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[reflect(Component, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub struct RsmView {
    /// The light.
    pub light: Entity,
    /// The GI camera whose surroundings it covers; `None` where the map serves all cameras.
    pub camera: Option<Entity>,
    /// Cube face of a point light, 0 to 5. Cascade of a directional light: 0 is the far one and 1
    /// the near one.
    pub face: u8,
}

/// Where a map's camera is. It has a `GlobalTransform` only from when it is due to the end of the frame:
/// Bevy counts all entities that are cameras and have one among the 32 views that ranges of visibility
/// are kept for, and those of the app come behind.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub(super) struct MapPlace(pub GlobalTransform);

/// A light's reflective shadow map. In both worlds, beside [`RsmView`]; the renderer has its
/// [`RsmLight`] as a component, too.
#[derive(Component, Clone, Debug, PartialEq)]
pub(in crate::gi) struct LightMap {
    /// Its light, and its place in the store.
    pub light: RsmLight,
    pub cut: CascadeCut,
    pub shading: GiShading,
    /// Render layers of its light: the map draws meshes, and serves cameras, that share one of them.
    pub layers: RenderLayers,
    /// What its light matters to GI cameras. Above 0; those of other maps compare with it.
    pub importance: f32,
    /// Share of its light that cameras get, 0 to 1: below 1 while it fades in or out.
    pub share: f32,
    pub age: MapAge,
}

/// How up to date a map's texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) struct MapAge {
    /// Frames for which the scene has differed from its texels; 0 where it does not.
    pub stale: u32,
    /// Whether its range of the store holds its texels.
    pub filled: bool,
    /// Whether texels of other maps are wrong until it is rendered.
    pub urgent: bool,
}

impl MapAge {
    /// Of a map that was not rendered yet.
    pub(super) const NEW: Self = Self { stale: 1, filled: false, urgent: false };
    /// Of a map that is rendered in this frame.
    pub(super) const FRESH: Self = Self { stale: 0, filled: true, urgent: false };
}

impl SyncComponent for LightMap {
    type Target = (RsmView, LightMap, RsmLight);
}

impl ExtractComponent for LightMap {
    type QueryData = (&'static RsmView, &'static LightMap);
    type QueryFilter = ();
    type Out = (RsmView, LightMap, RsmLight);

    fn extract_component((view, map): QueryItem<Self::QueryData>) -> Option<Self::Out> {
        Some((*view, map.clone(), map.light))
    }
}

/// Maps render before every camera that an app orders; each has its own order.
const FIRST_ORDER: isize = isize::MIN / 2;

/// A map that should exist in this frame. Until [`MapSlots`] lays it out, it has no place in the
/// store.
pub(super) struct MapSpec {
    pub view: RsmView,
    pub transform: Transform,
    pub projection: Projection,
    pub map: LightMap,
}

impl MapSpec {
    /// Unique, as offsets in the store are: cameras of equal order and target are ambiguous to
    /// Bevy.
    pub(super) fn order(&self) -> isize {
        FIRST_ORDER + self.map.light.texel_offset as isize
    }
}

/// Rows and texels that emissive surfaces and patches may need besides maps.
const OTHER_ROWS: u64 = 4096;
const OTHER_TEXELS: u64 = 32_768;

/// Texels, and rows of them, that the device can still take. A row of a map is a row of workgroups,
/// and all texels of the app are one storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MapCapacity {
    rows: u64,
    pub texels: u64,
}

impl MapCapacity {
    /// That of a device.
    pub(super) fn new(limits: &WgpuLimits) -> Self {
        Self {
            rows: u64::from(limits.max_compute_workgroups_per_dimension).saturating_sub(OTHER_ROWS),
            texels: (largest_storage_buffer(limits) / TEXEL_BYTES).saturating_sub(OTHER_TEXELS),
        }
    }

    /// Reserves maps of `resolution` texels along their edges, if all of them fit;
    /// warns once if not.
    pub(super) fn take(&mut self, maps: usize, resolution: u32) -> bool {
        let rows = maps as u64 * u64::from(resolution);
        let texels = rows * u64::from(resolution);
        let fits = rows <= self.rows && texels <= self.texels;
        if fits {
            (self.rows, self.texels) = (self.rows - rows, self.texels - texels);
        } else {
            warn_once!(
                "the reflective shadow maps of all lights exceed this GPU's limits: the least important lights do not bounce (lower FrugalGi::rsm_resolution or GiLimits::max_rsm_count)"
            );
        }
        fits
    }
}

/// The range of texels of each map.
#[derive(Resource, Debug)]
pub(super) struct MapSlots {
    of: BTreeMap<RsmView, Range<u32>>,
    ranges: RangeAllocator<u32>,
}

impl Default for MapSlots {
    fn default() -> Self {
        Self { of: BTreeMap::new(), ranges: RangeAllocator::new(0..u32::MAX) }
    }
}

impl MapSlots {
    /// Sorts maps and assigns each its offset in the store: the one that it had, or that of the
    /// smallest gap that it fits into. All move together where gaps would take as much as the maps,
    /// or the store would end behind `most` texels.
    pub(super) fn lay_out(&mut self, maps: &mut [MapSpec], most: u64) {
        maps.sort_by_key(|map| map.view);
        let texels: BTreeMap<RsmView, u32> =
            maps.iter().map(|map| (map.view, map.map.light.resolution.pow(2))).collect();
        self.update(&texels);
        let used: u64 = texels.values().map(|texels| u64::from(*texels)).sum();
        let end = self.of.values().map(|range| u64::from(range.end)).max().unwrap_or(0);
        if end > most || end > 2 * used {
            *self = Self::default();
            self.update(&texels);
        }
        for map in maps {
            map.map.light.texel_offset = self.of[&map.view].start;
        }
    }

    /// Takes the ranges of maps that are gone or have another size, and gives one to each map that
    /// has none.
    fn update(&mut self, texels: &BTreeMap<RsmView, u32>) {
        self.of.retain(|key, range| {
            let is_kept = texels.get(key) == Some(&(range.end - range.start));
            if !is_kept {
                self.ranges.free_range(range.clone());
            }
            is_kept
        });
        for (key, texels) in texels {
            self.of.entry(*key).or_insert_with(|| {
                self.ranges.allocate_range(*texels).expect("maps have fewer than 2^32 texels")
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_that_fit_are_taken_and_others_are_not() {
        let mut capacity = MapCapacity::new(&WgpuLimits::default());
        // 128 MiB are 4 M texels.
        assert!(!capacity.take(1, 2048), "with the texels of other sources it is too large");
        assert!(capacity.take(3, 1024) && !capacity.take(1, 1024) && capacity.take(1, 512));
        // 65,535 rows of workgroups.
        let large = WgpuLimits {
            max_storage_buffer_binding_size: u64::MAX,
            max_buffer_size: u64::MAX,
            ..Default::default()
        };
        let mut capacity = MapCapacity::new(&large);
        assert!(capacity.take(29, 2048) && !capacity.take(1, 2048) && capacity.take(1, 1024));
        let none = WgpuLimits { max_storage_buffer_binding_size: 0, ..Default::default() };
        assert!(!MapCapacity::new(&none).take(1, 16) && MapCapacity::new(&none).take(0, 16));
    }

    fn key(light: u32) -> RsmView {
        // Entities are ordered from the last to the first.
        let light = Entity::from_raw_u32(1000 - light).expect("an entity");
        RsmView { light, camera: None, face: 0 }
    }

    fn filled(slots: &mut MapSlots, maps: &[(u32, u32)]) -> Vec<u32> {
        let texels = maps.iter().map(|(light, texels)| (key(*light), *texels)).collect();
        slots.update(&texels);
        maps.iter().map(|(light, _)| slots.of[&key(*light)].start).collect()
    }

    #[test]
    fn maps_stay_in_place_while_others_come_and_go() {
        let mut slots = MapSlots::default();
        assert_eq!(filled(&mut slots, &[(1, 16), (2, 64), (3, 16)]), [0, 16, 80]);
        // One goes; smaller ones fill its gap, a larger one goes to the end.
        assert_eq!(filled(&mut slots, &[(1, 16), (3, 16)]), [0, 80]);
        assert_eq!(
            filled(&mut slots, &[(0, 16), (1, 16), (3, 16), (4, 100), (5, 48)]),
            [16, 0, 80, 96, 32]
        );
        // One that changes its size moves, and no other.
        assert_eq!(filled(&mut slots, &[(1, 16), (3, 64), (4, 100)]), [0, 16, 96]);
    }

    #[test]
    fn ranges_never_overlap() {
        let mut slots = MapSlots::default();
        let mut state = 1u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) % below
        };
        for _ in 0..200 {
            let maps: Vec<(u32, u32)> = (0..20)
                .map(|light| (light, 8 << random(4)))
                .filter(|(_, texels)| *texels > 8)
                .collect();
            filled(&mut slots, &maps);
            let mut ranges: Vec<_> = slots.of.values().cloned().collect();
            ranges.sort_by_key(|range| range.start);
            assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start), "{ranges:?}");
            assert_eq!(ranges.len(), maps.len());
        }
    }
}

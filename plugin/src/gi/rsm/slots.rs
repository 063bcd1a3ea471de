//! Room for maps' texels: how many the device can hold, and where each map's lie in the store.

use std::collections::BTreeMap;
use std::ops::Range;

use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::WgpuLimits;

use super::map::{MapSpec, RsmView};
use crate::gi::compute::{largest_storage_buffer, limits_of};
use crate::gi::texels::TEXEL_BYTES;

/// Rows and texels that emissive surfaces and patches may need besides maps.
const OTHER_ROWS: u64 = 4096;
const OTHER_TEXELS: u64 = 32_768;

/// Texels, and rows of them, that the device can still take. A row of a map is a row of workgroups,
/// and all texels of the app are one storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MapCapacity {
    rows: u64,
    texels: u64,
}

impl MapCapacity {
    /// That of a device; see [`limits_of`].
    pub(super) fn new(device: Option<&RenderDevice>) -> Self {
        Self::with(&limits_of(device))
    }

    fn with(limits: &WgpuLimits) -> Self {
        Self {
            rows: u64::from(limits.max_compute_workgroups_per_dimension).saturating_sub(OTHER_ROWS),
            texels: (largest_storage_buffer(limits) / TEXEL_BYTES).saturating_sub(OTHER_TEXELS),
        }
    }

    /// Texels that the device can still take.
    pub(super) fn texels(&self) -> u64 {
        self.texels
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

/// Order of maps that does not depend on the iteration of entities.
pub(in crate::gi) type MapKey = (Entity, Option<Entity>, u8);

impl RsmView {
    /// What maps are ordered by.
    pub(in crate::gi) fn key(&self) -> MapKey {
        (self.light, self.camera, self.face)
    }
}

/// The range of texels of each map.
#[derive(Resource, Clone, Debug, Default)]
pub(super) struct MapSlots(BTreeMap<MapKey, Range<u32>>);

impl MapSlots {
    /// Sorts maps and assigns each its offset in the store: the one that it had, or the first gap
    /// that it fits into. All move together where gaps would take as much as the maps, or the store
    /// would end behind `most` texels.
    pub(super) fn lay_out(&mut self, maps: &mut [MapSpec], most: u64) {
        maps.sort_by_key(|map| map.view.key());
        let texels: BTreeMap<MapKey, u32> =
            maps.iter().map(|map| (map.view.key(), map.map.light.resolution.pow(2))).collect();
        self.0.retain(|key, range| texels.get(key) == Some(&(range.end - range.start)));
        self.fill(&texels);
        let used: u64 = texels.values().map(|texels| u64::from(*texels)).sum();
        let end = self.0.values().map(|range| u64::from(range.end)).max().unwrap_or(0);
        if end > most || end > 2 * used {
            self.0.clear();
            self.fill(&texels);
        }
        for map in maps {
            map.map.light.texel_offset = self.0[&map.view.key()].start;
        }
    }

    /// Gives a range to each map that has none.
    fn fill(&mut self, texels: &BTreeMap<MapKey, u32>) {
        if self.0.len() == texels.len() {
            return;
        }
        let mut taken: Vec<Range<u32>> = self.0.values().cloned().collect();
        taken.sort_by_key(|range| range.start);
        for (key, texels) in texels {
            if self.0.contains_key(key) {
                continue;
            }
            let mut start = 0;
            let at = taken
                .iter()
                .position(|range| {
                    let fits = start + texels <= range.start;
                    if !fits {
                        start = range.end;
                    }
                    fits
                })
                .unwrap_or(taken.len());
            taken.insert(at, start..start + texels);
            self.0.insert(*key, start..start + texels);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_that_fit_are_taken_and_others_are_not() {
        let mut capacity = MapCapacity::with(&WgpuLimits::default());
        // 128 MiB are 4 M texels.
        assert!(!capacity.take(1, 2048), "with the texels of other sources it is too large");
        assert!(capacity.take(3, 1024) && !capacity.take(1, 1024) && capacity.take(1, 512));
        // 65,535 rows of workgroups.
        let large = WgpuLimits {
            max_storage_buffer_binding_size: u64::MAX,
            max_buffer_size: u64::MAX,
            ..Default::default()
        };
        let mut capacity = MapCapacity::with(&large);
        assert!(capacity.take(29, 2048) && !capacity.take(1, 2048) && capacity.take(1, 1024));
        let none = WgpuLimits { max_storage_buffer_binding_size: 0, ..Default::default() };
        assert!(!MapCapacity::with(&none).take(1, 16) && MapCapacity::with(&none).take(0, 16));
    }

    fn key(light: u32, face: u8) -> MapKey {
        // Entities are ordered from the last to the first.
        (Entity::from_raw_u32(1000 - light).expect("an entity"), None, face)
    }

    fn filled(slots: &mut MapSlots, maps: &[(u32, u32)]) -> Vec<u32> {
        let texels = maps.iter().map(|(light, texels)| (key(*light, 0), *texels)).collect();
        slots
            .0
            .retain(|key, range| BTreeMap::get(&texels, key) == Some(&(range.end - range.start)));
        slots.fill(&texels);
        maps.iter().map(|(light, _)| slots.0[&key(*light, 0)].start).collect()
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
            let mut ranges: Vec<_> = slots.0.values().cloned().collect();
            ranges.sort_by_key(|range| range.start);
            assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start), "{ranges:?}");
            assert_eq!(ranges.len(), maps.len());
        }
    }
}

//! Ranges of the store: a map keeps its texels in place while other maps come and go.

use std::collections::BTreeMap;
use std::ops::Range;

use bevy::ecs::prelude::*;

use super::RsmView;
use super::specs::MapSpec;

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
            maps.iter().map(|map| (map.view.key(), map.resolution.pow(2))).collect();
        self.0.retain(|key, range| texels.get(key) == Some(&(range.end - range.start)));
        self.fill(&texels);
        let used: u64 = texels.values().map(|texels| u64::from(*texels)).sum();
        let end = self.0.values().map(|range| u64::from(range.end)).max().unwrap_or(0);
        if end > most || end > 2 * used {
            self.0.clear();
            self.fill(&texels);
        }
        for map in maps {
            map.light.texel_offset = self.0[&map.view.key()].start;
            map.light.resolution = map.resolution;
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

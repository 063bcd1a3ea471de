//! The candidates of a camera's patches, from which they are chosen again where a mesh moves.

use bevy::platform::collections::HashMap;

use super::choice::{PATCHES, Patch, PatchFocus, choose, threshold};
use super::points::{PatchCandidate, PatchInstance, PatchKey, PatchPoints};

/// The floor of candidates, as a share of the threshold, or of the most that this may be. Lower values hold
/// more of them; higher values look at all surfaces again sooner as meshes move.
const FLOOR: f32 = 0.3;
/// Factor by which the floor falls where too few candidates are found.
const FALL: f32 = 0.1;
/// Most candidates that are held, as a multiple of the patches.
const MOST: usize = 8;

/// All surfaces.
pub(super) struct Places<'a> {
    pub held: &'a HashMap<PatchKey, Option<PatchPoints>>,
    pub instances: &'a [PatchInstance],
    /// Number of each instance; `None` without points.
    pub numbers: &'a [Option<u32>],
    /// Indices of those with a number, in its order.
    pub order: &'a [usize],
}

/// Those points of all surfaces that may become a camera's patches: only a mesh that moves is looked at
/// again.
pub(super) struct Chosen {
    pub focus: PatchFocus,
    /// Of each instance, those whose priority exceeds the floor.
    candidates: Vec<Vec<PatchCandidate>>,
    floor: f32,
}

impl Chosen {
    /// Of a camera for which nothing was chosen.
    pub(super) fn new(focus: PatchFocus) -> Self {
        Self { focus, candidates: Vec::new(), floor: 0.0 }
    }

    /// The patches. `moved`: the instances that did so since the last time; without it, all are looked at.
    /// `importance`: of all instances.
    pub(super) fn patches(
        &mut self,
        places: &Places,
        moved: Option<&[usize]>,
        importance: f64,
    ) -> Vec<Patch> {
        if let Some(moved) = moved {
            moved.iter().for_each(|index| self.find(places, *index));
            if let Some(patches) = self.choose(places) {
                return patches;
            }
        }
        let floor = FLOOR * (importance / PATCHES as f64) as f32;
        self.floor = if floor.is_finite() { floor.max(0.0) } else { 0.0 };
        let lowest = 1e-6 * self.floor;
        loop {
            self.candidates.clear();
            self.candidates.resize(places.instances.len(), Vec::new());
            places.order.iter().for_each(|index| self.find(places, *index));
            if let Some(patches) = self.choose(places) {
                return patches;
            }
            self.floor = if self.floor > lowest { FALL * self.floor } else { 0.0 };
        }
    }

    /// Looks at a surface's points.
    fn find(&mut self, places: &Places, index: usize) {
        let (instance, found) = (&places.instances[index], &mut self.candidates[index]);
        found.clear();
        if let (Some(number), Some(Some(points))) =
            (places.numbers[index], places.held.get(&instance.key))
        {
            // A multiple of the golden ratio.
            let seed = number.wrapping_mul(2_654_435_769);
            points.candidates_above(self.floor, (instance, seed), &self.focus, found);
        }
    }

    /// The patches among the candidates, padded; `None` where there are too few of these. Raises the floor
    /// where there are too many.
    fn choose(&mut self, places: &Places) -> Option<Vec<Patch>> {
        let all: Vec<PatchCandidate> =
            places.order.iter().flat_map(|index| &self.candidates[*index]).copied().collect();
        let threshold = threshold(&all, PATCHES);
        if threshold.is_none() && self.floor > 0.0 {
            return None;
        }
        let mut patches: Vec<Patch> = choose(&all, threshold)
            .map(|((position, normal, sample), area)| Patch::new(position, area, normal, &sample))
            .collect();
        patches.resize(PATCHES, Patch::default());
        let floor = FLOOR * threshold.unwrap_or(0.0);
        if all.len() > MOST * PATCHES && floor > self.floor {
            self.floor = floor;
            for held in &mut self.candidates {
                held.retain(|candidate| candidate.is_above(floor));
            }
        }
        Some(patches)
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::AssetId;
    use bevy::ecs::entity::Entity;
    use bevy::math::{Affine3A, Quat, Vec3};
    use bevy::pbr::StandardMaterial;

    use super::*;
    use crate::gi::surfaces::{MaterialSample, Reflectance, SurfacePoints};

    fn sample() -> MaterialSample {
        MaterialSample { color: Vec3::ONE, roughness: 1.0, metallic: 0.0, reflectance: 0.5 }
    }

    /// A triangle of half a square metre.
    fn points() -> PatchPoints {
        let triangle = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
        PatchPoints::of(SurfacePoints::new(&triangle, 64, |_| Some(sample())).expect("an area"))
    }

    /// Numbers in 0 to 1 (a linear congruence of 64 bits; Knuth 1997, section 3.3.4).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 40) as f32 / 16_777_216.0
        }
    }

    fn place(random: &mut Random, size: f32) -> Affine3A {
        let position = Vec3::from_array([(); 3].map(|()| size * (2.0 * random.next() - 1.0)));
        let turn = Quat::from_rotation_y(6.0 * random.next());
        Affine3A::from_scale_rotation_translation(Vec3::new(1.0, 2.0, 1.0), turn, position)
    }

    #[test]
    fn what_moved_alone_is_looked_at_again_and_the_patches_are_those_of_all() {
        let reflectance = Reflectance::new(&StandardMaterial {
            double_sided: true,
            cull_mode: None,
            ..Default::default()
        });
        let key = PatchKey {
            mesh: AssetId::invalid(),
            reflectance: reflectance.expect("an opaque material"),
        };
        let held = HashMap::from_iter([(key, Some(points()))]);
        let focus = PatchFocus::new(Entity::PLACEHOLDER, Vec3::ZERO, 40.0, None);
        // Few of them have no more points than there are patches.
        for count in [0, 3, 15, 600] {
            let mut random = Random(count as u64);
            let mut instances: Vec<PatchInstance> = (0..count)
                .map(|_| PatchInstance {
                    entity: Entity::PLACEHOLDER,
                    key,
                    affine: place(&mut random, 60.0),
                    material: (),
                })
                .collect();
            // The second has no points.
            let numbers: Vec<Option<u32>> =
                (0..count).map(|index| (index != 1).then_some((count - index) as u32)).collect();
            let order: Vec<usize> = (0..count).rev().filter(|index| *index != 1).collect();
            let mut kept = Chosen::new(focus);
            let mut moved: Option<Vec<usize>> = None;
            for round in 0..20 {
                let places =
                    Places { held: &held, instances: &instances, numbers: &numbers, order: &order };
                let importance = instances.iter().map(|instance| {
                    held[&key].as_ref().unwrap().importance(&instance.affine, &[focus])
                });
                let importance = importance.sum();
                let found = kept.patches(&places, moved.as_deref(), importance);
                let all = Chosen::new(focus).patches(&places, None, importance);
                assert!(found == all, "{count} surfaces, round {round}");
                let mut without_floor = Chosen::new(focus);
                assert!(without_floor.patches(&places, None, 0.0) == all, "{count}, {round}");
                let area: f32 = all.iter().map(|patch| patch.area).sum();
                let there = all.iter().filter(|patch| patch.area > 0.0).count();
                // Two sides of 64 points; priorities may be equal.
                let expected = (order.len() * 128).min(PATCHES);
                assert!((expected - expected / 500..=expected).contains(&there), "{there}");
                assert!(count < 600 || area > 100.0, "{area}");
                if count == 600 {
                    let most: usize = kept.candidates.iter().map(Vec::len).sum();
                    assert!((PATCHES..MOST * PATCHES).contains(&most), "{most} of 76,672");
                }
                // Nearer and nearer, so that more and more come above the floor.
                let chosen: Vec<usize> =
                    (0..count / 5).map(|_| (random.next() * count as f32) as usize).collect();
                for index in &chosen {
                    instances[*index].affine = place(&mut random, 60.0 - 2.5 * round as f32);
                }
                moved = Some(chosen);
            }
        }
    }
}

//! Which lights have maps, over time: without flicker between lights of equal importance, and
//! without steps in the image.

use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;

/// Factor by which another light must matter more to take a light's maps. Higher values: fewer
/// exchanges, and lights that matter less stay longer.
const HYSTERESIS: f32 = 1.25;
/// Seconds in which a light fades in or out when it gets maps or loses them to another. Higher
/// values: exchanges show less, and maps of both lights are kept for longer.
const FADE_SECONDS: f32 = 0.5;
/// Most maps of lights that fade out, besides those of the chosen ones.
const MAX_LEAVING: usize = 24;

/// A light in the competition for maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    pub light: Entity,
    /// Above 0, in any unit.
    pub importance: f32,
    /// Maps that it takes.
    pub maps: usize,
}

/// What a light had in the last frame.
#[derive(Clone, Copy, Debug)]
struct Held {
    is_chosen: bool,
    share: f32,
}

/// The lights of the last frame. A resource of the main world.
#[derive(Resource, Clone, Debug, Default)]
pub(super) struct LightSelection(EntityHashMap<Held>);

impl LightSelection {
    /// Forgets earlier frames: at a camera cut, so that what follows does not depend on them.
    pub(super) fn forget(&mut self) {
        self.0.clear();
    }

    /// The lights that have maps in this frame, the most important ones first, and the share of its
    /// light that each sends: below 1 while it fades. `take` reserves maps of a candidate where the
    /// device has room. A new light is there at once; one that was known and left out fades in.
    ///
    /// `most`: maps of all chosen lights. `seconds` since the last frame.
    pub(super) fn next(
        &mut self,
        candidates: &[Candidate],
        most: usize,
        seconds: f32,
        mut take: impl FnMut(&Candidate) -> bool,
    ) -> Vec<(Entity, f32)> {
        // Time may stand still, and NaN counts for 0.
        let step = if seconds > 0.0 { seconds / FADE_SECONDS } else { 0.0 };
        let mut ranked: Vec<(f32, &Candidate)> = candidates
            .iter()
            .map(|candidate| {
                let is_chosen = self.0.get(&candidate.light).is_some_and(|held| held.is_chosen);
                (candidate.importance * if is_chosen { HYSTERESIS } else { 1.0 }, candidate)
            })
            .collect();
        // Ties are broken by entity, so that the choice does not flicker.
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.light.cmp(&b.1.light)));
        let mut left = most;
        let mut next = EntityHashMap::default();
        let mut lit = Vec::new();
        let mut leaving = Vec::new();
        for (_, candidate) in ranked {
            let held = self.0.get(&candidate.light);
            let is_chosen = candidate.maps <= left && take(candidate);
            let share = match held {
                None => f32::from(u8::from(is_chosen)),
                Some(held) if is_chosen => (held.share + step).min(1.0),
                Some(held) => (held.share - step).max(0.0),
            };
            next.insert(candidate.light, Held { is_chosen, share });
            if is_chosen {
                left -= candidate.maps;
                lit.push((candidate.light, share));
            } else if share > 0.0 {
                leaving.push((candidate, share));
            }
        }
        let mut left = if most > 0 { MAX_LEAVING } else { 0 };
        for (candidate, share) in leaving {
            if candidate.maps <= left && take(candidate) {
                left -= candidate.maps;
                lit.push((candidate.light, share));
            } else if let Some(held) = next.get_mut(&candidate.light) {
                held.share = 0.0;
            }
        }
        self.0 = next;
        lit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entity(index: u32) -> Entity {
        Entity::from_raw_u32(index).expect("an entity")
    }

    fn candidates(importance: &[f32]) -> Vec<Candidate> {
        let candidate = |(index, importance): (u32, &f32)| Candidate {
            light: entity(index),
            importance: *importance,
            maps: 6,
        };
        (0..).zip(importance).map(candidate).collect()
    }

    /// Two lights' maps; a tenth of a fade a frame.
    fn frame(selection: &mut LightSelection, importance: &[f32]) -> Vec<(u32, f32)> {
        let lit = selection.next(&candidates(importance), 12, 0.1 * FADE_SECONDS, |_| true);
        lit.into_iter().map(|(light, share)| (light.index_u32(), share)).collect()
    }

    #[test]
    fn what_matters_most_is_there_at_once() {
        let mut selection = LightSelection::default();
        assert_eq!(frame(&mut selection, &[1.0, 3.0, 2.0]), [(1, 1.0), (2, 1.0)]);
        // A new one, brighter than all: at once, and the one that makes room fades.
        let found = frame(&mut selection, &[1.0, 3.0, 2.0, 9.0]);
        assert_eq!(found[..2], [(3, 1.0), (1, 1.0)]);
        assert!(found[2].0 == 2 && (found[2].1 - 0.9).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn lights_are_exchanged_without_steps() {
        let mut selection = LightSelection::default();
        frame(&mut selection, &[3.0, 2.0, 1.0]);
        let mut last = [1.0, 1.0, 0.0];
        for _ in 0..15 {
            let mut now = [0.0; 3];
            for (light, share) in frame(&mut selection, &[3.0, 1.0, 2.0]) {
                now[light as usize] = share;
            }
            for (now, last) in now.iter().zip(last) {
                assert!((now - last).abs() < 0.11, "{now} after {last}");
            }
            last = now;
        }
        assert_eq!(last, [1.0, 0.0, 1.0]);
    }

    #[test]
    fn lights_of_nearly_equal_importance_do_not_flicker() {
        let mut selection = LightSelection::default();
        let first = frame(&mut selection, &[3.0, 2.0, 1.9]);
        for turn in 0..20 {
            let importance = if turn % 2 == 0 { [3.0, 1.9, 2.0] } else { [3.0, 2.0, 1.9] };
            assert_eq!(frame(&mut selection, &importance), first);
        }
        selection.forget();
        assert_eq!(frame(&mut selection, &[3.0, 1.9, 2.0]), [(0, 1.0), (2, 1.0)], "after a cut");
    }

    #[test]
    fn limits_and_broken_clocks_are_respected() {
        let mut selection = LightSelection::default();
        let lights = candidates(&[3.0, 2.0, 1.0]);
        assert_eq!(selection.next(&lights, 0, 0.1, |_| true), []);
        assert_eq!(selection.next(&lights, 5, 0.1, |_| true), [], "too few for a point light");
        for seconds in [f32::NAN, -1.0, 0.0, f32::INFINITY] {
            let mut selection = LightSelection::default();
            selection.next(&lights, 12, 0.1, |_| true);
            let other = candidates(&[1.0, 2.0, 3.0]);
            let lit = selection.next(&other, 12, seconds, |_| true);
            assert!(lit.iter().all(|(_, share)| (0.0..=1.0).contains(share)), "{seconds}: {lit:?}");
        }
        // A device without room for the second light.
        let mut room = 1;
        let take = |_: &Candidate| {
            room -= 1;
            room >= 0
        };
        assert_eq!(LightSelection::default().next(&lights, 12, 0.1, take), [(entity(0), 1.0)]);
    }
}

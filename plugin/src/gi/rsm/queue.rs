//! Which maps are rendered in a frame: those that are out of date, as many as the app allows.

use bevy::ecs::prelude::*;

use super::map::MapAge;

/// A map that may be rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MapRequest {
    /// Light, and camera that the map serves: such maps are rendered in the same frame, since
    /// cascades cover each other.
    pub group: (Entity, Option<Entity>),
    /// Its light's, above 0.
    pub importance: f32,
    pub age: MapAge,
}

/// When maps may be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Gate {
    /// Only urgent ones.
    Urgent,
    /// Up to so many maps, but at least those of one light.
    Most(usize),
    /// All that are stale: at a camera cut, so that what follows does not depend on what was
    /// rendered before.
    All,
}

/// Of maps sorted by group: whether each is rendered. First come maps whose texels are not there
/// yet, then those that matter most or have waited longest.
pub(super) fn due(maps: &[MapRequest], gate: Gate) -> Vec<bool> {
    let mut groups: Vec<(&[MapRequest], usize)> = Vec::new();
    let mut first = 0;
    for group in maps.chunk_by(|a, b| a.group == b.group) {
        if group.iter().any(|map| map.age.stale > 0) {
            groups.push((group, first));
        }
        first += group.len();
    }
    let rank = |(group, _): &(&[MapRequest], usize)| {
        let any = |is: fn(&MapAge) -> bool| group.iter().any(|map| is(&map.age));
        let waited = group.iter().map(|map| map.age.stale).max().unwrap_or(0) as f32;
        let importance = group.iter().map(|map| map.importance).fold(0.0, f32::max);
        (any(|age| age.urgent), any(|age| !age.filled), importance * waited)
    };
    groups.sort_by(|a, b| {
        let (a, b) = (rank(a), rank(b));
        (b.0, b.1).cmp(&(a.0, a.1)).then(b.2.total_cmp(&a.2))
    });
    let mut is_due = vec![false; maps.len()];
    let mut count = 0;
    for (group, first) in groups {
        // Of a point light, only the faces that changed.
        let stale = group.iter().filter(|map| map.age.stale > 0).count();
        let is_urgent = group.iter().any(|map| map.age.urgent);
        let fits = match gate {
            Gate::Urgent => false,
            Gate::Most(most) => count == 0 || count + stale <= most,
            Gate::All => true,
        };
        if fits || is_urgent {
            count += stale;
            for (offset, map) in group.iter().enumerate() {
                is_due[first + offset] = map.age.stale > 0;
            }
        }
    }
    is_due
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(light: u32, importance: f32, age: MapAge) -> MapRequest {
        let group = (Entity::from_raw_u32(light).expect("an entity"), None);
        MapRequest { group, importance, age }
    }

    const FRESH: MapAge = MapAge::FRESH;
    const STALE: MapAge = MapAge { stale: 1, ..FRESH };
    const EMPTY: MapAge = MapAge::NEW;

    #[test]
    fn nothing_is_rendered_that_is_up_to_date() {
        let maps = [map(0, 1.0, FRESH), map(1, 1.0, FRESH)];
        for gate in [Gate::Urgent, Gate::Most(24), Gate::All] {
            assert_eq!(due(&maps, gate), [false; 2]);
        }
        assert_eq!(due(&[], Gate::All), [] as [bool; 0]);
    }

    #[test]
    fn only_faces_that_changed_are_rendered() {
        let maps = [map(0, 1.0, FRESH), map(0, 1.0, STALE), map(0, 1.0, FRESH), map(1, 9.0, STALE)];
        assert_eq!(due(&maps, Gate::Most(24)), [false, true, false, true]);
    }

    #[test]
    fn all_maps_of_a_light_wait_for_room_together() {
        let maps: Vec<_> =
            (0..4).flat_map(|light| [map(light, 4.0 - light as f32, STALE); 6]).collect();
        let lights =
            |gate| -> Vec<bool> { due(&maps, gate).chunks(6).map(|faces| faces[0]).collect() };
        assert_eq!(lights(Gate::Most(12)), [true, true, false, false]);
        assert_eq!(lights(Gate::Most(17)), [true, true, false, false]);
        assert_eq!(lights(Gate::Most(1)), [true, false, false, false], "something goes on");
        assert_eq!(lights(Gate::Urgent), [false; 4]);
        assert_eq!(lights(Gate::All), [true; 4]);
    }

    #[test]
    fn empty_maps_come_first_then_importance_times_waiting() {
        let waited = |stale| MapAge { stale, ..STALE };
        let maps = [
            map(0, 100.0, waited(1)),
            map(1, 1.0, EMPTY),
            map(2, 10.0, waited(11)),
            map(3, 2.0, waited(60)),
        ];
        let order = |count: usize| due(&maps, Gate::Most(count));
        assert_eq!(order(1), [false, true, false, false]);
        assert_eq!(order(2), [false, true, false, true]);
        assert_eq!(order(3), [false, true, true, true]);
    }

    #[test]
    fn nothing_waits_for_ever() {
        let mut maps: Vec<_> = (0..40).map(|light| map(light, 1.0 + light as f32, STALE)).collect();
        let mut rendered = vec![0; maps.len()];
        for _ in 0..400 {
            let due = due(&maps, Gate::Most(4));
            for ((map, due), rendered) in maps.iter_mut().zip(due).zip(&mut rendered) {
                map.age.stale = if due { 1 } else { map.age.stale + 1 };
                *rendered += u32::from(due);
            }
        }
        assert!(rendered.iter().all(|count| *count > 0), "{rendered:?}");
    }

    #[test]
    fn urgent_maps_are_rendered_through_a_closed_gate() {
        let maps = [map(0, 1.0, MapAge { urgent: true, ..STALE }), map(1, 9.0, STALE)];
        assert_eq!(due(&maps, Gate::Urgent), [true, false]);
        assert_eq!(due(&maps, Gate::Most(1)), [true, false]);
    }
}

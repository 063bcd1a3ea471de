//! The work of a frame, as plain arithmetic over what changed.

use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::extract_resource::ExtractResource;

/// When reflective shadow maps are rendered and light is gathered. A resource of the main world.
#[derive(Resource, ExtractResource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Clone, PartialEq)]
#[non_exhaustive]
pub enum GiRefresh {
    /// When meshes, their materials' handles, standard materials, images, lights, skins or morphs
    /// moved or changed. Cameras also gather when they moved. While any mesh has another kind of
    /// material, all is as with [`EveryFrame`](Self::EveryFrame), since such a material may change
    /// by itself.
    #[default]
    OnChange,
    /// As `OnChange`, but cameras gather in every frame, as if they moved. Measures the cost of a
    /// walk through a still scene.
    #[doc(hidden)]
    AsIfCamerasMoved,
    /// Everything in every frame. For changes that Bevy does not report: vertex shaders that move
    /// by the clock, buffers that the GPU writes.
    EveryFrame,
}

/// Frames for which an asset counts as arriving. It is prepared in its first frame or the next;
/// objects derived from it are prepared, and drawn, in the one after.
const ARRIVAL: u32 = 4;

/// The work of this frame.
#[derive(Resource, ExtractResource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct GiFrame {
    /// Frames since the last camera cut or shift, so that the frames after it do not depend on its
    /// time.
    pub number: u32,
    /// Whether maps are rendered.
    pub maps: bool,
    /// Whether texels of maps, or what they count for, changed; where there are no maps, whether they
    /// would be rendered.
    pub relit: bool,
    /// Maps that are out of date and wait for their turn.
    pub waiting: u32,
    /// Whether cameras gather even if they have not moved.
    pub gather: bool,
    /// Frames since a visible change of the scene.
    pub(in crate::gi) frames_since_change: u32,
    /// Frames for which an asset is still arriving.
    pub(in crate::gi) arriving: u32,
}

/// What happened since the last frame that may make maps out of date.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::gi) struct MapChanges {
    /// Something visible changed.
    pub changed: bool,
    /// An asset was added, changed or removed.
    pub arrived: bool,
    /// Something may not be rendered yet.
    pub missing: bool,
    /// All work is due in every frame.
    pub always: bool,
    /// A map was never rendered where its texels are.
    pub unfilled: bool,
    /// A camera has a cut, or its world was shifted.
    pub cut: bool,
}

impl GiFrame {
    /// The next frame's, in which maps are rendered if any is out of date. `period`: frames from one
    /// rendering of the maps to the next.
    pub(crate) fn next(self, changes: MapChanges, period: u32) -> Self {
        let number = if changes.cut { 0 } else { self.number.wrapping_add(1) };
        let frames_since_change = if changes.changed || changes.unfilled {
            0
        } else {
            self.frames_since_change.saturating_add(1)
        };
        let arriving = if changes.arrived {
            ARRIVAL
        } else {
            self.arriving.saturating_sub(1).max(u32::from(changes.missing))
        };
        // A whole period from the last change on: one frame in it renders maps.
        // What waits was due in an earlier frame.
        let waits = self.waiting > 0;
        let gather = changes.always || arriving > 0 || waits || frames_since_change < period;
        // Texels at a new position in the store must be written before they are sampled, and the
        // period must not delay what was missing.
        Self {
            number,
            frames_since_change,
            arriving,
            gather,
            maps: changes.unfilled
                || arriving > 0
                || waits
                || gather && number.is_multiple_of(period),
            relit: false,
            waiting: 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: MapChanges = MapChanges {
        changed: false,
        arrived: false,
        missing: false,
        always: false,
        unfilled: false,
        cut: false,
    };
    const CHANGE: MapChanges = MapChanges { changed: true, ..NOTHING };

    #[test]
    fn maps_rest_after_the_last_change() {
        let frame = GiFrame::default().next(CHANGE, 1);
        assert!(frame.maps && frame.gather);
        let frame = frame.next(NOTHING, 1);
        assert!(!frame.maps && !frame.gather);
        assert!(frame.next(MapChanges { always: true, ..NOTHING }, 1).maps);
    }

    #[test]
    fn maps_render_while_assets_arrive() {
        let mut frame = GiFrame { frames_since_change: 99, ..Default::default() }
            .next(MapChanges { arrived: true, ..NOTHING }, 1);
        for _ in 0..ARRIVAL {
            assert!(frame.maps && frame.gather);
            frame = frame.next(NOTHING, 1);
        }
        assert!(!frame.maps && !frame.gather);
    }

    #[test]
    fn maps_follow_the_period_and_render_once_after_the_last_change() {
        for period in 1..=8 {
            for offset in 0..period {
                let mut frame = GiFrame { number: offset, ..Default::default() };
                let mut rendered = 0;
                for _ in 0..4 * period {
                    frame = frame.next(CHANGE, period);
                    rendered += u32::from(frame.maps);
                }
                assert_eq!(rendered, 4, "every {period}th frame");
                let last = u32::from(frame.maps);
                let after = (0..20).filter(|_| {
                    frame = frame.next(NOTHING, period);
                    frame.maps
                });
                assert_eq!(last + after.count() as u32, 1, "period {period} from {offset}");
            }
        }
    }

    #[test]
    fn new_and_missing_objects_are_rendered_at_once() {
        let frame = GiFrame { number: 0, frames_since_change: 99, ..Default::default() };
        assert!(!frame.next(CHANGE, 8).maps);
        assert!(frame.next(MapChanges { arrived: true, ..NOTHING }, 8).maps);
        assert!(frame.next(MapChanges { missing: true, ..NOTHING }, 8).maps);
        assert!(frame.next(MapChanges { unfilled: true, ..NOTHING }, 8).maps);
        let waiting = GiFrame { waiting: 3, ..frame }.next(NOTHING, 8);
        assert!(waiting.maps && waiting.gather);
    }

    #[test]
    fn a_cut_begins_a_period() {
        for number in 0..8 {
            let cut = GiFrame { number, frames_since_change: 99, ..Default::default() }
                .next(MapChanges { cut: true, ..CHANGE }, 4);
            assert!(cut.maps && cut.gather);
            let mut frame = cut;
            let rendered: Vec<_> = std::iter::from_fn(|| {
                frame = frame.next(CHANGE, 4);
                Some(frame.maps)
            })
            .take(5)
            .collect();
            assert_eq!(rendered, [false, false, false, true, false], "from {number}");
        }
    }

    #[test]
    fn counters_wrap_or_saturate() {
        let end = GiFrame { number: u32::MAX, frames_since_change: u32::MAX, ..Default::default() };
        assert_eq!(end.next(NOTHING, u32::MAX).number, 0);
        assert!(!end.next(NOTHING, 1).gather);
    }
}

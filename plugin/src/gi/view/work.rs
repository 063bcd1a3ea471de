//! The work of a camera in a frame: plain arithmetic over what changed.

use super::frame::{GiFrame, GiRefresh};

/// The work of a camera in a frame. The composite is drawn in every frame, and not part of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct Work {
    /// Sampling of VPLs.
    pub sample: bool,
    /// Gather and denoising.
    pub gather: bool,
    /// Frames since any of their inputs changed.
    pub frames_since_change: u32,
}

impl Work {
    /// Everything.
    pub(crate) const ALL: Self = Self { sample: true, gather: true, frames_since_change: 0 };

    /// The next frame's. `changed`: the camera, its sky or its settings changed. `always`: its
    /// pixels are jittered, or its sky is generated in each frame.
    pub(crate) fn next(
        self,
        changed: bool,
        always: bool,
        frame: &GiFrame,
        policy: GiRefresh,
        period: u32,
    ) -> Self {
        let frames_since_change =
            if changed { 0 } else { self.frames_since_change.saturating_add(1) };
        // A whole period from the last change on: in one of its frames VPLs are sampled for the
        // camera's final pose.
        let gather =
            frame.gather || always || policy != GiRefresh::OnChange || frames_since_change < period;
        Self {
            frames_since_change,
            gather,
            sample: gather && (frame.maps || frame.number.is_multiple_of(period)),
        }
    }
}

/// What a frame does with the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) enum Step {
    /// Nothing is gathered: the history's weight falls to 0.
    Rests,
    /// Light is gathered after a cut, or at rest: the history starts over.
    Begins,
    /// Something moves: the history goes on.
    Moves,
    /// The settings or the sky changed. The history is carried over, also to another resolution.
    Switches,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: u32, moving: bool) -> GiFrame {
        GiFrame { number, maps: moving, gather: moving, ..Default::default() }
    }

    fn resting() -> Work {
        Work { frames_since_change: 99, ..Default::default() }
    }

    #[test]
    fn a_still_camera_in_a_still_scene_rests() {
        let gathers = |changed, moving, policy| {
            resting().next(changed, false, &frame(1, moving), policy, 1).gather
        };
        assert!(!gathers(false, false, GiRefresh::OnChange));
        assert!(
            gathers(true, false, GiRefresh::OnChange) && gathers(false, true, GiRefresh::OnChange)
        );
        assert!(gathers(false, false, GiRefresh::AsIfCamerasMoved));
        assert!(
            resting().next(false, true, &frame(1, false), GiRefresh::OnChange, 1).gather,
            "jittered"
        );
    }

    #[test]
    fn after_a_camera_s_last_move_vpls_are_sampled_once_more() {
        for period in 1..=8 {
            for start in 0..period {
                let mut work = resting();
                let sampled = (0..20).filter(|number| {
                    work = work.next(
                        *number == 0,
                        false,
                        &frame(start + number, false),
                        GiRefresh::OnChange,
                        period,
                    );
                    work.sample
                });
                assert_eq!(sampled.count(), 1, "period {period} from {start}");
                assert!(!work.gather);
            }
        }
    }

    #[test]
    fn sampling_follows_the_period_and_the_maps() {
        let samples = |number, maps| {
            let frame = GiFrame { number, maps, gather: true, ..Default::default() };
            Work::default().next(true, false, &frame, GiRefresh::OnChange, 4).sample
        };
        assert_eq!(
            [0, 1, 2, 3, 4].map(|number| samples(number, false)),
            [true, false, false, false, true]
        );
        assert!(samples(1, true), "the texels are no longer there");
    }
}

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
    /// Frames for which the camera has rested: nothing that it shows changes. While it gathers, each
    /// of them has other samples, of the weights of the last frame before.
    pub rested: u32,
}

impl Work {
    /// Everything.
    pub(crate) const ALL: Self =
        Self { sample: true, gather: true, frames_since_change: 0, rested: 0 };

    /// The next frame's. `changed`: the camera, its sky or its settings changed. `always`: its
    /// pixels are jittered, or its sky is generated in each frame. `rest_frames`: for how many frames
    /// it gathers at rest.
    pub(crate) fn next(
        self,
        changed: bool,
        always: bool,
        frame: &GiFrame,
        policy: GiRefresh,
        period: u32,
        rest_frames: u32,
    ) -> Self {
        let frames_since_change =
            if changed { 0 } else { self.frames_since_change.saturating_add(1) };
        // A whole period from the last change on: in one of its frames VPLs are sampled for the
        // camera's final pose.
        if frame.gather || always || policy != GiRefresh::OnChange || frames_since_change < period {
            let sample = frame.maps || frame.number.is_multiple_of(period);
            return Self { sample, gather: true, frames_since_change, rested: 0 };
        }
        let rested = self.rested.saturating_add(1);
        let averages = rested <= rest_frames;
        Self { sample: averages, gather: averages, frames_since_change, rested }
    }

    /// Whether VPLs are sampled by the weights of an earlier frame.
    pub(crate) fn samples_again(&self) -> bool {
        self.sample && self.rested > 0
    }
}

/// What a frame does with the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) enum HistoryAction {
    /// Nothing changes, and light is gathered with other samples: their mean converges.
    Averages,
    /// Nothing is gathered. If nothing was averaged, the history's weight falls to 0.
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
            resting().next(changed, false, &frame(1, moving), policy, 1, 0).gather
        };
        assert!(!gathers(false, false, GiRefresh::OnChange));
        assert!(
            gathers(true, false, GiRefresh::OnChange) && gathers(false, true, GiRefresh::OnChange)
        );
        assert!(gathers(false, false, GiRefresh::AsIfCamerasMoved));
        assert!(
            resting().next(false, true, &frame(1, false), GiRefresh::OnChange, 1, 0).gather,
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
                        0,
                    );
                    work.sample
                });
                assert_eq!(sampled.count(), 1, "period {period} from {start}");
                assert!(!work.gather);
            }
        }
    }

    #[test]
    fn a_camera_at_rest_gathers_other_samples_and_then_nothing() {
        for (period, rest_frames) in [(1, 0), (1, 8), (3, 8), (8, 1)] {
            let mut work = Work::ALL;
            let mut next = |number, changed| {
                work = work.next(
                    changed,
                    false,
                    &frame(number, false),
                    GiRefresh::OnChange,
                    period,
                    rest_frames,
                );
                work
            };
            let moving = next(0, true);
            assert!(moving.gather && !moving.samples_again());
            let again: Vec<u32> = (1..40)
                .map(|number| next(number, false))
                .filter(Work::samples_again)
                .map(|work| work.rested)
                .collect();
            assert_eq!(again, (1..=rest_frames).collect::<Vec<_>>(), "period {period}");
            assert!(!next(40, false).gather);
            assert_eq!(next(41, true).rested, 0, "moves again");
        }
    }

    #[test]
    fn a_rest_without_end_counts_without_overflow() {
        let work = Work { rested: u32::MAX, ..resting() };
        let next = work.next(false, false, &frame(1, false), GiRefresh::OnChange, 1, 256);
        assert!(next.rested == u32::MAX && !next.gather);
    }

    #[test]
    fn sampling_follows_the_period_and_the_maps() {
        let samples = |number, maps| {
            let frame = GiFrame { number, maps, gather: true, ..Default::default() };
            Work::default().next(true, false, &frame, GiRefresh::OnChange, 4, 0).sample
        };
        assert_eq!(
            [0, 1, 2, 3, 4].map(|number| samples(number, false)),
            [true, false, false, false, true]
        );
        assert!(samples(1, true), "the texels are no longer there");
    }
}

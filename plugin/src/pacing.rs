//! Frame-rate cap: the most effective power knob where the display allows it.

use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;

/// Maximum frame rate. Lower values save power in proportion and make motion less smooth.
///
/// The app sleeps at the end of each frame, so a display with vertical synchronization shows such
/// rates evenly only if they divide its own. Without effect in a browser, which paces frames
/// itself.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct FrameRateLimit {
    /// Frames per second; `None`, 0, negative and infinite values, and NaN are no limit. Values
    /// below 1 count as 1. Default: `None`.
    pub hertz: Option<f64>,
}

/// How long the app waited at the end of the last frame.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub(crate) struct FrameWait(pub(crate) Duration);

/// Adds [`FrameRateLimit`] and keeps it.
#[derive(Clone, Copy, Debug, Default)]
pub struct FramePacingPlugin;

impl Plugin for FramePacingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FrameRateLimit>()
            .init_resource::<FrameWait>()
            .register_type::<FrameRateLimit>()
            .add_systems(Last, keep_frame_rate.run_if(is_limited));
    }
}

/// Whether there is a limit, or was one in the last frame.
fn is_limited(limit: Res<FrameRateLimit>) -> bool {
    limit.hertz.is_some() || limit.is_changed()
}

fn keep_frame_rate(
    limit: Res<FrameRateLimit>,
    mut waited: ResMut<FrameWait>,
    mut deadline: Local<Deadline>,
) {
    waited.0 = Duration::ZERO;
    #[cfg(not(target_arch = "wasm32"))]
    {
        let start = Instant::now();
        if let Some(wait) = deadline.next(limit.hertz, start) {
            std::thread::sleep(wait);
            waited.0 = start.elapsed();
        }
    }
    #[cfg(target_arch = "wasm32")]
    let _ = (limit, &mut *deadline);
}

/// Longest time of a frame: lower limits count as this one.
const MAX_SECONDS: f64 = 1.0;

/// End of the current frame's time.
#[derive(Clone, Copy, Debug, Default)]
struct Deadline(Option<Instant>);

impl Deadline {
    /// Time to wait at `now` before the next frame, with at most `limit` frames per second; `None`
    /// if it may begin.
    ///
    /// Deadlines are evenly spaced, so that the next wait makes up for a sleep that took too long.
    /// A frame that is late by more than one period starts anew.
    fn next(&mut self, limit: Option<f64>, now: Instant) -> Option<Duration> {
        let limit = limit.filter(|limit| *limit > 0.0 && limit.is_finite());
        let Some(limit) = limit else {
            self.0 = None;
            return None;
        };
        let period = Duration::from_secs_f64(limit.recip().min(MAX_SECONDS));
        let due = self.0.map_or(now + period, |last| last + period);
        let is_late = due + period < now;
        // A lower limit before may have left a deadline far ahead.
        let due = if is_late { now } else { due.min(now + period) };
        self.0 = Some(due);
        due.checked_duration_since(now).filter(|wait| !wait.is_zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn millis(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    #[test]
    fn frames_are_even_and_late_ones_do_not_add_up() {
        let (mut deadline, start) = (Deadline::default(), Instant::now());
        let mut wait = |at: u64| deadline.next(Some(100.0), start + millis(at));
        assert_eq!(wait(0), Some(millis(10)));
        assert_eq!(wait(14), Some(millis(6)), "4 ms of work");
        assert_eq!(wait(26), Some(millis(4)), "waking up took 2 ms too long");
        assert_eq!(wait(95), None, "late by several frames");
        assert_eq!(wait(96), Some(millis(9)), "which are not made up for");
    }

    #[test]
    fn odd_limits_are_none_or_bounded() {
        let (mut deadline, now) = (Deadline::default(), Instant::now());
        for odd in [None, Some(f64::NAN), Some(0.0), Some(-1.0), Some(f64::INFINITY)] {
            assert_eq!(deadline.next(odd, now), None, "{odd:?}");
        }
        for slow in [1e-300, f64::MIN_POSITIVE, 0.1] {
            let wait = Deadline::default().next(Some(slow), now);
            assert_eq!(wait, Some(millis(1000)), "{slow}");
        }
        // A limit that is lifted leaves no wait behind, nor does one that rises.
        assert!(deadline.next(Some(1.0), now).is_some());
        assert_eq!(deadline.next(Some(100.0), now), Some(millis(10)));
        assert_eq!(deadline.next(Some(1e300), now), None);
    }

    #[test]
    fn frames_take_at_least_their_time() {
        let mut app = App::new();
        app.add_plugins(FramePacingPlugin).insert_resource(FrameRateLimit { hertz: Some(200.0) });
        // From before the first frame, from which all others are due.
        let start = Instant::now();
        app.update();
        (0..10).for_each(|_| app.update());
        // Sleeping may take longer on a busy machine, but never less.
        assert!(start.elapsed() >= Duration::from_millis(45), "{:?}", start.elapsed());
    }
}

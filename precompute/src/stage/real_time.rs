//! Power of frames at their own frame rate, by a meter of a whole device.
//!
//! Frames start when an app's would, and the device rests between them as it does in an app: its
//! clocks and its resting power are those of that load, and no model of idle power is needed.

use std::time::{Duration, Instant};

use bevy_frugal_gi::power::MeterError;

use crate::meters::{Mean, Sampled};

/// Length of a measurement by a meter whose own window is no longer than `SHORT_WINDOW_SECONDS`:
/// from step to step it is exact.
const WINDOW: Duration = Duration::from_millis(500);
const SHORT_WINDOW_SECONDS: f64 = 1.0;

/// Renders `frame` after `frame` at `frames_per_second`, and meters them. Where frames take longer
/// than that, they follow each other at once.
///
/// # Errors
/// When the meter gives no valid readings.
pub(super) fn meter_frames(
    meter: &Sampled,
    frames_per_second: f64,
    frame: &mut dyn FnMut(),
) -> Result<Mean, MeterError> {
    let own = meter.window_seconds();
    let window = if own <= SHORT_WINDOW_SECONDS { WINDOW } else { Duration::from_secs_f64(own) };
    // The stage has checked the rate; this only keeps the arithmetic from panicking.
    let interval = Duration::try_from_secs_f64(frames_per_second.recip()).unwrap_or(WINDOW);
    let mut next = Instant::now();
    meter.mean(window, &mut || {
        frame();
        // A late frame is followed at once, but what was missed is not made up for.
        next = (next + interval).max(Instant::now());
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meters::Meter;
    use crate::meters::testing::Steps;

    #[test]
    fn frames_keep_their_rate_while_they_are_metered() {
        let Ok(Meter::Measured(meter)) = Meter::new(Box::new(Steps::new(80.0))) else {
            panic!("a thread")
        };
        let mean = meter_frames(&meter, 50.0, &mut || ()).expect("a power");
        assert!((mean.power.0 - 80.0).abs() < 8.0, "{mean:?}");
        assert!((10.0..51.5).contains(&mean.rate), "{mean:?}");
    }
}

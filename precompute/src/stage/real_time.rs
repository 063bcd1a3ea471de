//! Power of frames at their own frame rate, by a meter of a whole device.
//!
//! Frames start when an app's would, and the device rests between them as it does in an app: its
//! clocks and its resting power are those of that load, and no model of idle power is needed.
//!
//! Counters of energy rise in steps, NVML's by the energy of 0.1 s. A window from one step to another
//! is exact, where one from a moment to another is off by up to a step at either end: 10 % of a
//! second.

use std::time::{Duration, Instant};

use bevy_frugal_gi::power::{EnergyWindow, MeterError, PowerMeter};
use bevy_frugal_gi::units::Joules;

/// Frames are rendered for this long before a window, so that clocks and regulators have settled.
const SETTLE: Duration = Duration::from_millis(200);
/// Length of a window from step to step.
const WINDOW: Duration = Duration::from_millis(500);
/// A step that takes longer to come is not waited for: the window is then the meter's own.
const STEP: Duration = Duration::from_millis(250);
/// Windows are at most this long, whatever a meter says.
const LONGEST_WINDOW_SECONDS: f64 = 60.0;
/// Time between two looks at the counter while a step is awaited.
const POLL: Duration = Duration::from_millis(1);

/// Energy of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Metered {
    pub spent: Joules,
    pub seconds: f64,
    /// Frames in the window, at least 1.
    pub frames: u32,
}

/// Renders `frame` after `frame` at `frames_per_second`, and meters them. Where frames take longer
/// than that, they follow each other at once.
///
/// # Errors
/// When the meter cannot be read.
pub(super) fn meter_frames(
    meter: &mut dyn PowerMeter,
    frames_per_second: f64,
    frame: &mut dyn FnMut(),
) -> Result<Metered, MeterError> {
    let mut pace = Pace::new(frames_per_second);
    let started = Instant::now();
    while started.elapsed() < SETTLE {
        pace.frame(frame, || Ok(false))?;
    }
    let window = if is_at_step(meter, &mut pace, frame)? {
        WINDOW
    } else {
        let seconds = meter.window_seconds();
        let seconds = if seconds.is_nan() { 1.0 } else { seconds };
        Duration::from_secs_f64(seconds.clamp(WINDOW.as_secs_f64(), LONGEST_WINDOW_SECONDS))
    };
    let start = EnergyWindow::start(meter)?;
    pace.frames = 0;
    while start.elapsed() < window {
        pace.frame(frame, || Ok(false))?;
    }
    is_at_step(meter, &mut pace, frame)?;
    let (spent, elapsed) = start.finish(meter)?;
    Ok(Metered { spent, seconds: elapsed.as_secs_f64(), frames: pace.frames.max(1) })
}

/// Renders until the counter rises, or gives up.
fn is_at_step(
    meter: &mut dyn PowerMeter,
    pace: &mut Pace,
    frame: &mut dyn FnMut(),
) -> Result<bool, MeterError> {
    let started = Instant::now();
    let before = meter.energy()?;
    while started.elapsed() < STEP {
        if pace.frame(frame, || Ok(meter.energy()? != before))? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Starts frames at a fixed rate.
struct Pace {
    interval: Duration,
    next: Instant,
    frames: u32,
}

impl Pace {
    fn new(frames_per_second: f64) -> Self {
        // The stage has checked the rate; this only keeps the arithmetic from panicking.
        let interval = Duration::try_from_secs_f64(frames_per_second.recip()).unwrap_or(WINDOW);
        Self { interval, next: Instant::now(), frames: 0 }
    }

    /// Renders one frame, and waits until the next is due, or until `is_over`.
    fn frame(
        &mut self,
        frame: &mut dyn FnMut(),
        mut is_over: impl FnMut() -> Result<bool, MeterError>,
    ) -> Result<bool, MeterError> {
        frame();
        self.frames += 1;
        // A late frame is followed at once, but what was missed is not made up for.
        self.next = (self.next + self.interval).max(Instant::now());
        loop {
            if is_over()? {
                return Ok(true);
            }
            let left = self.next.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(false);
            }
            std::thread::sleep(left.min(POLL));
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::power::{MeterInfo, Provenance};

    use super::*;

    /// A device of a constant power whose counter has a new value every `step_seconds`, or none.
    struct Steps {
        origin: Instant,
        watts: f64,
        step_seconds: f64,
    }

    impl PowerMeter for Steps {
        fn info(&self) -> MeterInfo {
            MeterInfo {
                name: "steps".to_owned(),
                provenance: Provenance::Measured,
                description: String::new(),
            }
        }
        fn energy(&mut self) -> Result<Joules, MeterError> {
            let steps = (self.origin.elapsed().as_secs_f64() / self.step_seconds).floor();
            Ok(Joules(steps * self.step_seconds * self.watts))
        }
        fn window_seconds(&self) -> f64 {
            1.0
        }
    }

    #[test]
    fn a_window_from_step_to_step_is_exact() {
        let mut meter = Steps { origin: Instant::now(), watts: 80.0, step_seconds: 0.1 };
        let mut frames = 0;
        let metered = meter_frames(&mut meter, 50.0, &mut || frames += 1).unwrap();
        let power = metered.spent.0 / metered.seconds;
        // Unaligned it is off by up to 20 %. The rest is for a loaded machine.
        assert!((power - 80.0).abs() < 8.0, "{power} W in {metered:?}");
        let rate = f64::from(metered.frames) / metered.seconds;
        assert!(
            (10.0..51.5).contains(&rate) && frames > metered.frames,
            "{rate} frames per second"
        );
    }

    #[test]
    fn a_counter_that_stands_still_ends() {
        let mut meter = Steps { origin: Instant::now(), watts: 80.0, step_seconds: f64::INFINITY };
        // 0 × ∞ is not a number.
        assert!(meter_frames(&mut meter, 1000.0, &mut || ()).is_err());
        meter = Steps { origin: Instant::now(), watts: 80.0, step_seconds: 1e6 };
        let metered = meter_frames(&mut meter, 1000.0, &mut || ()).unwrap();
        assert_eq!(metered.spent, Joules(0.0));
        assert!(metered.frames > 1);
    }
}

//! Energy of frames, and their power at the target frame rate.
//!
//! p = idle + energy per frame × frames per second. A meter of a whole device measures that directly:
//! frames start when an app's would, and the device rests between them as it does in an app. Where it
//! cannot hold the rate, its idle power is taken out of the energy of a frame; it is measured once,
//! while nothing is rendered.

use std::time::{Duration, Instant};

use frugal_trace::scene::CameraPose;

use super::meters::{Mean, Meter, Source};
use super::{NO_METER, Stage, StageError, StageOptions};
use crate::power::{Adapter, MeterError};
use crate::units::Watts;

/// Steps of the meter's counter in a window, for an error of a few per cent.
const STEPS_PER_WINDOW: f64 = 10.0;
/// Windows of a meter below this, seconds, are as short as a frame.
pub(super) const SHORT_WINDOW: f64 = 0.01;
/// Share of the target frame rate from which frames count as rendered at that rate.
const HELD_RATE: f64 = 0.97;
/// Length of a measurement by a meter whose own window is no longer than `MAX_STEP_SECONDS`: from
/// step to step it is exact.
const WINDOW: Duration = Duration::from_millis(500);
const MAX_STEP_SECONDS: f64 = 1.0;

/// Opens the meter that `options` name, or the one that covers `adapter`.
pub(super) fn open(options: &StageOptions, adapter: &Adapter) -> Result<Option<Meter>, StageError> {
    let opened = match options.meter.as_deref() {
        Some(NO_METER) => return Ok(None),
        Some(name) => crate::power::open(name),
        None => crate::power::detect(adapter),
    };
    let meter = Meter::new(opened.map_err(StageError::usage)?);
    meter.map(Some).map_err(StageError::failed)
}

impl Stage {
    /// Power of the current settings, over at least `least` frames, and more where the meter's
    /// resolution needs them; `None` without a meter. `pose` gives the camera's pose in each frame,
    /// `None` to keep it.
    ///
    /// # Errors
    /// When the meter cannot be read.
    pub(super) fn metered(
        &mut self,
        pose: impl Fn(usize) -> Option<CameraPose>,
        least: usize,
    ) -> Result<Option<Watts>, StageError> {
        let frame = |stage: &mut Self, number: usize| {
            if let Some(pose) = pose(number) {
                stage.place(pose.position, pose.rotation);
            }
            stage.frame();
        };
        // Taken out, so that frames can be rendered while it is read.
        let Some(mut meter) = self.meter.take() else {
            (0..least.max(1)).for_each(|number| frame(self, number));
            return Ok(None);
        };
        let rate = self.options.frames_per_second;
        let power = meter.frames(rate, least, &mut |number| frame(self, number));
        let name = meter.info.name.clone();
        self.meter = Some(meter);
        let power = power.map_err(StageError::failed)?;
        if power.0.is_finite() && power.0 > 0.0 {
            return Ok(Some(power));
        }
        let error = MeterError::broken(name, format!("gave {power} for rendered frames"));
        Err(StageError::failed(error))
    }

    /// Idle power: measured where the meter covers the whole device, otherwise the meter's own
    /// figure; 0 without a meter. The first call takes seconds where it is measured.
    ///
    /// # Errors
    /// When the meter cannot be read.
    pub(super) fn idle(&mut self) -> Result<Watts, StageError> {
        self.meter.as_mut().map_or(Ok(Watts(0.0)), Meter::idle).map_err(StageError::failed)
    }
}

impl Meter {
    /// Power at `rate` frames per second, from at least `least` frames.
    fn frames(
        &mut self,
        rate: f64,
        least: usize,
        frame: &mut dyn FnMut(usize),
    ) -> Result<Watts, MeterError> {
        let per_frame = match &mut self.source {
            Source::Measured(_) => {
                let mean = self.paced(rate, frame)?;
                if mean.rate >= HELD_RATE * rate {
                    return Ok(mean.power);
                }
                (mean.power - self.idle()?).0 / mean.rate
            }
            Source::Modelled(meter, _) => {
                let is_short = self.window_seconds < SHORT_WINDOW;
                let seconds = if is_short { 0.0 } else { STEPS_PER_WINDOW * self.window_seconds };
                let before = meter.energy()?;
                let (start, mut count) = (Instant::now(), 0);
                while count < least.max(1) || start.elapsed().as_secs_f64() < seconds {
                    frame(count);
                    count += 1;
                }
                (meter.energy()? - before).0 / count as f64
            }
        };
        Ok(self.idle()? + Watts(per_frame.max(0.0) * rate))
    }

    /// Renders frame after frame at `rate` per second, and meters them in real time. Where frames take
    /// longer than that, they follow each other at once.
    fn paced(&mut self, rate: f64, frame: &mut dyn FnMut(usize)) -> Result<Mean, MeterError> {
        let own = self.window_seconds;
        let window = if own <= MAX_STEP_SECONDS { WINDOW } else { Duration::from_secs_f64(own) };
        // The stage has checked the rate; this only keeps the arithmetic from panicking.
        let interval = Duration::try_from_secs_f64(rate.recip()).unwrap_or(WINDOW);
        let (mut next, mut count) = (Instant::now(), 0);
        self.mean(window, &mut || {
            frame(count);
            count += 1;
            // A late frame is followed at once, but what was missed is not made up for.
            next = (next + interval).max(Instant::now());
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage::meters::testing::Steps;

    #[test]
    fn frames_keep_their_rate_while_they_are_metered() {
        let mut meter = Meter::new(Box::new(Steps::new(80.0))).expect("a thread");
        let mean = meter.paced(50.0, &mut |_| ()).expect("a power");
        assert!((mean.power.0 - 80.0).abs() < 8.0, "{mean:?}");
        assert!((10.0..51.5).contains(&mean.rate), "{mean:?}");
    }
}

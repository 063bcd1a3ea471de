//! Energy of frames, and their power at the target frame rate.
//!
//! p = idle + energy per frame × frames per second. A meter of a whole device measures that directly:
//! frames start when an app's would, and the device rests between them as it does in an app. Where it
//! cannot hold the rate, its idle power is taken out of the energy of a frame; it is measured once,
//! while nothing is rendered.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::math::{Quat, Vec3};

use super::meters::{Mean, Meter, Sampled};
use super::{NO_METER, Stage, StageError, StageOptions};
use crate::power::{Adapter, MeterError};
use crate::units::{Joules, Watts};

/// Steps of the meter's counter in a window, for an error of a few per cent.
const STEPS_PER_WINDOW: f64 = 10.0;
/// Windows of a meter below this, seconds, are as short as a frame.
pub(super) const SHORT_WINDOW: f64 = 0.01;
/// Time in which a device's clocks fall after its last frame.
const REST: Duration = Duration::from_secs(2);
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
        Some(name) => crate::power::open(name)?,
        None => crate::power::detect(adapter)?,
    };
    Ok(Some(Meter::new(opened)?))
}

impl Stage {
    /// Power of the current settings, over at least `least` frames, and more where the meter's
    /// resolution needs them; `None` without a meter.
    ///
    /// # Errors
    /// When the meter cannot be read.
    pub fn metered_frames(&mut self, least: u32) -> Result<Option<Watts>, StageError> {
        self.metered(|_| None, least)
    }

    /// The same with a moving camera: `pose` gives its pose in each frame, `None` to keep it.
    pub(super) fn metered(
        &mut self,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
        least: u32,
    ) -> Result<Option<Watts>, StageError> {
        let power = match &self.meter {
            None => {
                (0..least.max(1)).for_each(|frame| self.posed_frame(pose(frame as usize)));
                return Ok(None);
            }
            Some(Meter::Measured(meter)) => {
                let meter = Arc::clone(meter);
                self.measured(&meter, pose)?
            }
            Some(Meter::Modelled(..)) => self.modelled(pose, least)?,
        };
        if power.0.is_finite() && power.0 > 0.0 {
            return Ok(Some(power));
        }
        Err(MeterError::broken(self.meter_name(), format!("gave {power} for rendered frames"))
            .into())
    }

    fn meter_name(&self) -> String {
        self.meter.as_ref().map_or_else(|| NO_METER.to_owned(), |meter| meter.info().name)
    }

    /// Power by a model of this process' work.
    fn modelled(
        &mut self,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
        least: u32,
    ) -> Result<Watts, StageError> {
        let seconds = self.meter.as_ref().map_or(0.0, Meter::window_seconds);
        let least_seconds = if seconds < SHORT_WINDOW { 0.0 } else { STEPS_PER_WINDOW * seconds };
        let before = self.energy()?;
        let start = Instant::now();
        let mut frames = 0;
        while frames < least.max(1) || start.elapsed().as_secs_f64() < least_seconds {
            self.posed_frame(pose(frames as usize));
            frames += 1;
        }
        let spent = self.energy()? - before;
        let per_frame = (spent.0 / f64::from(frames)).max(0.0);
        Ok(self.idle()? + Watts(per_frame * self.options.frames_per_second))
    }

    /// Energy that a model has counted.
    fn energy(&mut self) -> Result<Joules, MeterError> {
        match &mut self.meter {
            Some(Meter::Modelled(meter, _)) => meter.energy(),
            _ => Err(MeterError::unavailable(self.meter_name(), "it is read over a time")),
        }
    }

    /// Power by a meter of the whole device, in real time.
    fn measured(
        &mut self,
        meter: &Sampled,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
    ) -> Result<Watts, StageError> {
        let rate = self.options.frames_per_second;
        let mut shown = 0;
        let mean = meter_frames(meter, rate, &mut || {
            self.posed_frame(pose(shown));
            shown += 1;
        })?;
        if mean.rate >= HELD_RATE * rate {
            return Ok(mean.power);
        }
        let idle = self.idle()?;
        let per_frame = ((mean.power.0 - idle.0) / mean.rate).max(0.0);
        Ok(idle + Watts(per_frame * rate))
    }

    fn posed_frame(&mut self, pose: Option<(Vec3, Quat)>) {
        if let Some((position, rotation)) = pose {
            self.place(position, rotation);
        }
        self.frame();
    }

    /// Idle power: measured where the meter covers the whole device, otherwise the meter's own
    /// figure; 0 without a meter. The first call takes seconds where it is measured.
    ///
    /// # Errors
    /// When the meter cannot be read.
    pub fn idle(&mut self) -> Result<Watts, StageError> {
        if let Some(idle) = self.idle {
            return Ok(idle);
        }
        let idle = self.measure_idle()?;
        self.idle = Some(idle);
        Ok(idle)
    }

    fn measure_idle(&mut self) -> Result<Watts, StageError> {
        let meter = match &self.meter {
            Some(Meter::Measured(meter)) => meter,
            other => return Ok(other.as_ref().map_or(Watts(0.0), Meter::idle)),
        };
        // The device goes to rest first.
        std::thread::sleep(REST);
        let window = (2.0 * meter.window_seconds()).max(2.0);
        let mut rest = || std::thread::sleep(Duration::from_millis(10));
        Ok(meter.mean(Duration::from_secs_f64(window), &mut rest)?.power)
    }
}

/// Renders `frame` after `frame` at `frames_per_second`, and meters them. Where frames take longer
/// than that, they follow each other at once.
///
/// # Errors
/// When the meter gives no valid readings.
fn meter_frames(
    meter: &Sampled,
    frames_per_second: f64,
    frame: &mut dyn FnMut(),
) -> Result<Mean, MeterError> {
    let own = meter.window_seconds();
    let window = if own <= MAX_STEP_SECONDS { WINDOW } else { Duration::from_secs_f64(own) };
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
    use crate::stage::meters::testing::Steps;

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

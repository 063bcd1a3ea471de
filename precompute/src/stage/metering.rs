//! Energy of frames, and their power at the target frame rate.
//!
//! p = idle + energy per frame × frames per second. A meter that covers the whole device counts its
//! idle power in every window: it is measured once, while nothing is rendered, and subtracted.

use std::time::{Duration, Instant};

use bevy_frugal_gi::power::{Adapter, EnergyWindow, MeterError, PowerMeter, Provenance};
use bevy_frugal_gi::units::{Joules, Watts};
use glam::{Quat, Vec3};

use super::{Stage, StageError, StageOptions};
use crate::cost::{FrameLayout, WorkLedger, WorkMeter, is_work_meter};
use crate::scene::SceneDescription;

/// Steps of the meter's counter in a window, for an error of a few per cent.
const STEPS_PER_WINDOW: f64 = 10.0;

/// Opens the meter that `options` name, or the one that covers `adapter`. The ledger counts frames for
/// the work meter.
pub(super) fn open(
    scene: &SceneDescription,
    options: &StageOptions,
    adapter: &Adapter,
) -> Result<(Box<dyn PowerMeter>, Option<WorkLedger>), StageError> {
    let Some(name) = &options.meter else {
        return Ok((bevy_frugal_gi::power::detect(adapter)?, None));
    };
    if let Some(file) = is_work_meter(name) {
        let (meter, ledger) =
            WorkMeter::open(file, FrameLayout::of(scene, options.size.to_array()))?;
        return Ok((Box::new(meter), Some(ledger)));
    }
    Ok((bevy_frugal_gi::power::open(name)?, None))
}

impl Stage {
    /// Power at the target frame rate for an energy of `spent` over `frames` frames that took
    /// `seconds`.
    fn power(&self, spent: Joules, frames: u32, seconds: f64) -> Watts {
        let measured = self.meter.info().provenance == Provenance::Measured;
        let idle_energy = if measured { self.idle * seconds } else { Watts(0.0) };
        let per_frame = ((spent.0 - idle_energy.0) / f64::from(frames)).max(0.0);
        self.idle + Watts(per_frame * self.options.frames_per_second)
    }

    /// Power of the current settings, over at least `least` frames, and more where the meter's
    /// resolution needs them.
    ///
    /// # Errors
    /// When the meter cannot be read.
    pub fn metered_frames(&mut self, least: u32) -> Result<Watts, StageError> {
        self.metered(|_| None, least)
    }

    /// The same with a moving camera: `pose` gives its pose in each frame, `None` to keep it.
    pub(super) fn metered(
        &mut self,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
        least: u32,
    ) -> Result<Watts, StageError> {
        let least_seconds = if self.meter.window_seconds() < 0.01 {
            0.0
        } else {
            STEPS_PER_WINDOW * self.meter.window_seconds()
        };
        let window = EnergyWindow::start(self.meter.as_mut())?;
        let start = Instant::now();
        let mut frames = 0;
        while frames < least.max(1) || start.elapsed().as_secs_f64() < least_seconds {
            if let Some((position, rotation)) = pose(frames as usize) {
                self.place(position, rotation);
            }
            self.frame();
            frames += 1;
        }
        let (spent, elapsed) = window.finish(self.meter.as_mut())?;
        self.moved(spent)?;
        valid_power(self.power(spent, frames, elapsed.as_secs_f64()), &self.meter.info().name)
    }

    /// Idle power: measured where the meter covers the whole device, otherwise the meter's own
    /// figure.
    pub(super) fn measure_idle(&mut self) -> Result<Watts, StageError> {
        if self.meter.info().provenance != Provenance::Measured {
            return Ok(self.meter.idle());
        }
        let window = EnergyWindow::start(self.meter.as_mut())?;
        std::thread::sleep(Duration::from_secs_f64(
            (STEPS_PER_WINDOW * self.meter.window_seconds()).max(2.0),
        ));
        let (spent, elapsed) = window.finish(self.meter.as_mut())?;
        self.moved(spent)?;
        Ok(spent.per_seconds(elapsed.as_secs_f64()))
    }
}

impl Stage {
    /// A measured counter that stood still says nothing: its idle power would pass for that of the
    /// frames.
    fn moved(&self, spent: Joules) -> Result<(), StageError> {
        let info = self.meter.info();
        if info.provenance == Provenance::Measured && spent.0 == 0.0 {
            let reason = "the counter did not move in a window";
            return Err(MeterError::broken(info.name, reason).into());
        }
        Ok(())
    }
}

fn valid_power(power: Watts, meter: &str) -> Result<Watts, StageError> {
    if power.0.is_finite() && power.0 > 0.0 {
        Ok(power)
    } else {
        Err(MeterError::broken(meter, format!("gave {power} for rendered frames")).into())
    }
}

//! Energy of frames, and their power at the target frame rate.
//!
//! p = idle + energy per frame × frames per second. A meter of a whole device measures that directly:
//! frames are rendered at that rate (`real_time`). Where the device cannot hold the rate, its idle
//! power is taken out of the energy of a frame; it is measured once, while nothing is rendered.

use std::time::{Duration, Instant};

use bevy_frugal_gi::power::{Adapter, EnergyWindow, MeterError, MeterInfo, PowerMeter, Provenance};
use bevy_frugal_gi::units::{Joules, Watts};
use glam::{Quat, Vec3};

use super::{Stage, StageError, StageOptions, real_time};
use crate::cost::{FrameLayout, WorkLedger, WorkMeter, is_work_meter};
use crate::scene::SceneDescription;

/// Steps of the meter's counter in a window, for an error of a few per cent.
const STEPS_PER_WINDOW: f64 = 10.0;
/// Windows of a meter below this, seconds, are as short as a frame.
pub(super) const SHORT_WINDOW: f64 = 0.01;
/// Time in which a device's clocks fall after its last frame.
const REST: Duration = Duration::from_secs(2);
/// Share of the target frame rate from which frames count as rendered at that rate.
const HELD_RATE: f64 = 0.97;

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
        let power = if self.meter.info().provenance == Provenance::Measured {
            self.measured(pose)?
        } else {
            self.modelled(pose, least)?
        };
        valid_power(power, &self.meter.info().name)
    }

    /// Power by a meter of this process' work.
    fn modelled(
        &mut self,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
        least: u32,
    ) -> Result<Watts, StageError> {
        let seconds = self.meter.window_seconds();
        let least_seconds = if seconds < SHORT_WINDOW { 0.0 } else { STEPS_PER_WINDOW * seconds };
        let window = EnergyWindow::start(self.meter.as_mut())?;
        let start = Instant::now();
        let mut frames = 0;
        while frames < least.max(1) || start.elapsed().as_secs_f64() < least_seconds {
            self.posed_frame(pose(frames as usize));
            frames += 1;
        }
        let (spent, _) = window.finish(self.meter.as_mut())?;
        let per_frame = (spent.0 / f64::from(frames)).max(0.0);
        Ok(self.idle()? + Watts(per_frame * self.options.frames_per_second))
    }

    /// Power by a meter of the whole device, in real time.
    fn measured(
        &mut self,
        pose: impl Fn(usize) -> Option<(Vec3, Quat)>,
    ) -> Result<Watts, StageError> {
        let rate = self.options.frames_per_second;
        // The frames need the stage, and the window its meter.
        let mut meter = std::mem::replace(&mut self.meter, Box::new(NoMeter));
        let mut shown = 0;
        let metered = real_time::meter_frames(meter.as_mut(), rate, &mut || {
            self.posed_frame(pose(shown));
            shown += 1;
        });
        self.meter = meter;
        let metered = metered?;
        self.moved(metered.spent)?;
        let mean = metered.spent.per_seconds(metered.seconds);
        let frames = f64::from(metered.frames);
        if frames >= HELD_RATE * rate * metered.seconds {
            return Ok(mean);
        }
        let idle = self.idle()?;
        let per_frame = ((mean.0 - idle.0) * metered.seconds / frames).max(0.0);
        Ok(idle + Watts(per_frame * rate))
    }

    fn posed_frame(&mut self, pose: Option<(Vec3, Quat)>) {
        if let Some((position, rotation)) = pose {
            self.place(position, rotation);
        }
        self.frame();
    }

    /// Idle power: measured where the meter covers the whole device, otherwise the meter's own
    /// figure. The first call takes seconds where it is measured.
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
        if self.meter.info().provenance != Provenance::Measured {
            return Ok(self.meter.idle());
        }
        // The device goes to rest first.
        std::thread::sleep(REST);
        let window = EnergyWindow::start(self.meter.as_mut())?;
        std::thread::sleep(Duration::from_secs_f64((2.0 * self.meter.window_seconds()).max(2.0)));
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

/// Stands in for a stage's meter while that is read.
struct NoMeter;

impl PowerMeter for NoMeter {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: "none".to_owned(),
            provenance: Provenance::Modelled,
            description: "the meter is being read".to_owned(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        Err(MeterError::unavailable("none", "the meter is being read"))
    }

    fn window_seconds(&self) -> f64 {
        0.0
    }
}

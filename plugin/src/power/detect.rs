//! The available meters, and the choice of the one that covers the rendering device. A new meter is
//! one entry in [`METERS`].

use std::time::Duration;

// The standard one panics in a browser.
use bevy::platform::time::Instant;

use crate::power::meter::{MeterKind, Opened, Wanted};
#[cfg(any(windows, target_os = "macos"))]
use crate::power::notebook::KIND as BATTERY;
use crate::power::root::SysRoot;
use crate::power::sampler::Clock;
#[cfg(not(any(windows, target_os = "macos")))]
use crate::power::sysfs::battery::KIND as BATTERY;
use crate::power::sysfs::{gpu, jetson, rapl};
use crate::power::tracker::{PowerTracker, did_not_move};
use crate::power::{
    Adapter, MeterError, MeterState, OpenMeterError, PowerMeter, Provenance, Reading, cpu_time,
    nvml,
};

/// Time in which a counter must move when it is opened: the slowest update every two seconds.
const SETTLE_TIMEOUT: Duration = Duration::from_secs(5);
const SETTLE_INTERVAL: Duration = Duration::from_millis(20);

/// All meters in the order of detection: measured before modelled, and of the measured ones first
/// those that cover the GPU alone, then its package, its module, and the machine.
const METERS: &[&MeterKind] =
    &[&nvml::KIND, &gpu::AMD, &gpu::INTEL, &rapl::KIND, &jetson::KIND, &BATTERY, &cpu_time::KIND];

/// Name and syntax of each meter that [`open`] knows, in the order of detection: `cpu-time` and
/// `cpu-time[=WATTS_PER_CORE]`.
pub fn meters() -> Vec<(&'static str, &'static str)> {
    METERS.iter().map(|kind| (kind.name, kind.usage)).collect()
}

/// Opens the first meter that covers the rendering adapter and gives a reading. May take seconds:
/// do not call it on the main thread.
///
/// Meters of other devices are never used: on a machine with an NVIDIA board that renders in
/// software or on another vendor's GPU, NVML would meter an idle board. Software rendering has the
/// CPU time of this process: meters of the whole package or machine, which contain all programs, are
/// for those who name them.
///
/// # Errors
/// [`OpenMeterError::NoneSuits`], with a reason per meter.
pub fn detect(adapter: &Adapter) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    detect_in(&SysRoot::default(), adapter)
}

/// The same on a system under another root.
fn detect_in(root: &SysRoot, adapter: &Adapter) -> Opened {
    let mut reasons = Vec::new();
    for kind in METERS {
        match (kind.open)(root, Wanted::For(adapter)).and_then(probed) {
            Ok(meter) => return Ok(meter),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(OpenMeterError::NoneSuits { reasons })
}

/// Opens a meter by name, with an optional parameter after `=`: `nvml`, `nvml=1` (board index or
/// name), `amdgpu=0000:03:00.0`, `battery`, `cpu-time=5.0` (watts per busy core). The caller decides
/// whether it covers the rendering device. May take seconds.
///
/// # Errors
/// [`OpenMeterError`] when the name is unknown, the parameter is invalid, or the meter gives no
/// reading on this machine.
pub fn open(name: &str) -> Result<Box<dyn PowerMeter>, OpenMeterError> {
    open_in(&SysRoot::default(), name)
}

/// The same on a system under another root.
pub(crate) fn open_in(root: &SysRoot, name: &str) -> Opened {
    let (plain, wanted) = match name.split_once('=') {
        Some((plain, parameter)) => (plain.trim(), Wanted::Named(parameter.trim())),
        None => (name.trim(), Wanted::Usual),
    };
    let Some(kind) = METERS.iter().find(|kind| kind.name == plain) else {
        let known = METERS.iter().map(|kind| kind.usage).collect();
        return Err(OpenMeterError::UnknownName { name: plain.to_owned(), known });
    };
    if let Wanted::Named("") = wanted {
        return Err(OpenMeterError::Parameter {
            meter: kind.name.to_owned(),
            parameter: String::new(),
            expected: kind.expected.to_owned(),
        });
    }
    (kind.open)(root, wanted).and_then(probed)
}

/// Waits for the first valid reading: some libraries initialise successfully and then reject every
/// query, and some counters stand at 0 for ever.
fn probed(mut meter: Box<dyn PowerMeter>) -> Opened {
    let clock = Clock::since(Instant::now());
    let mut tracker = PowerTracker::new(meter.as_ref(), SETTLE_INTERVAL, Duration::ZERO);
    let first = meter.read()?;
    tracker.push(Ok(first.clone()), clock.now());
    if let MeterState::Lost { reason } = &tracker.snapshot().state {
        // The tracker names the meter, as the error does.
        let name = meter.info().name;
        let reason = reason.trim_start_matches(&format!("{name}: broken: ")).to_owned();
        return Err(MeterError::broken(name, reason).into());
    }
    let is_counter = matches!(first, Reading::Energy(_));
    while is_counter && meter.info().provenance == Provenance::Measured && meter.read()? == first {
        if clock.now().clock > SETTLE_TIMEOUT {
            let reason = did_not_move(SETTLE_TIMEOUT);
            return Err(MeterError::broken(meter.info().name, reason).into());
        }
        std::thread::sleep(SETTLE_INTERVAL);
    }
    Ok(meter)
}

#[cfg(test)]
#[path = "detect_tests.rs"]
mod tests;

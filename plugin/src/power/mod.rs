//! Power meters with their provenance, detection of the meter that covers the rendering device, and
//! a background sampler that publishes the app's power without blocking a frame on a counter.
//!
//! | item | job |
//! |---|---|
//! | [`PowerMeter`] | contract: cumulative energy with its provenance |
//! | [`CpuTimeMeter`], [`NvmlMeter`], and those of Linux' files by name | the meters |
//! | [`detect`], [`open`] | the meters of this machine, and the one that covers the rendering device |
//! | [`SimulatedDevice`], [`SimulatedMeter`] | a device with heat, throttling and a meter, in numbers |
//! | [`PowerPlugin`] | the sampler in a Bevy app: [`MeteredPower`] and a diagnostic |
//!
//! The feature `meter-tools` adds what a tool needs that measures on a thread of its own: `survey` of
//! this machine's meters, their `self_test`, and `EnergyWindow`.
//!
//! An unknown power is never reported as 0 W: a counter that is missing, unreadable or faulty gives
//! a [`MeterError`] or a [`MeterState`] with the reason.

mod adapter;
mod cpu_time;
mod detect;
mod meter;
#[cfg(feature = "nvml")]
mod nvml;
mod plugin;
mod sampler;
#[cfg(test)]
mod scripted;
#[cfg(any(test, feature = "meter-tools"))]
mod self_test;
mod simulated;
mod sysfs;
mod tracker;
mod window;

pub use adapter::{Adapter, AdapterKind};
pub use cpu_time::{CpuTimeMeter, InvalidWattsPerCore};
pub use detect::{OpenMeterError, detect, open};
#[cfg(feature = "meter-tools")]
pub use detect::{SurveyedMeter, survey};
pub use meter::{MeterError, MeterInfo, PowerMeter, Provenance};
#[cfg(feature = "nvml")]
pub use nvml::{BoardChoice, NvmlMeter};
pub use plugin::{
    MeterChoice, MeterFactory, MeteredPower, POWER_DIAGNOSTIC, PowerPlugin, PowerSystems,
};
pub(crate) use sampler::PowerSampler;
pub use sampler::SamplerSettings;
#[cfg(test)]
pub(crate) use scripted::ScriptedMeter;
#[cfg(feature = "meter-tools")]
pub use self_test::{SelfTest, Verdict, busy_cpu_load, self_test};
pub use simulated::{SimulatedDevice, SimulatedMeter};
pub use tracker::MeterState;
pub(crate) use tracker::PowerSnapshot;

use crate::units::{Joules, Watts};

/// Energy left in the machine's batteries, and the power that they give; `None` unless they alone
/// feed the machine. May take milliseconds, or hang with a driver.
pub(crate) fn battery_left() -> Option<(Joules, Watts)> {
    #[cfg(any(windows, target_os = "macos"))]
    return sysfs::notebook::left();
    #[cfg(not(any(windows, target_os = "macos")))]
    sysfs::battery::left(&sysfs::SysRoot::default())
}
#[cfg(feature = "meter-tools")]
pub use window::EnergyWindow;

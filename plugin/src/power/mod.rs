//! Power meters with their provenance, detection of the meter that covers the rendering device, and
//! a background sampler that publishes the app's power without blocking a frame on a counter.
//!
//! | item | job |
//! |---|---|
//! | [`PowerMeter`] | contract: cumulative energy with its provenance |
//! | [`CpuTimeMeter`], [`NvmlMeter`] | the meters |
//! | [`ScriptedMeter`] | a meter with scripted readings, for tests |
//! | [`SimulatedDevice`], [`SimulatedMeter`] | a device with heat, throttling and a meter, in numbers |
//! | [`detect`], [`open`], [`survey`] | the meters of this machine, and the one that covers the rendering device |
//! | [`self_test`] | whether a meter behaves like an energy counter |
//! | [`EnergyWindow`] | energy between two moments, for measurements on a thread of their own |
//! | [`PowerSampler`] | power over time, polled on a thread of its own |
//! | [`PowerPlugin`] | the sampler in a Bevy app: [`MeteredPower`] and a diagnostic |
//!
//! An unknown power is never reported as 0 W: a counter that is missing, unreadable or faulty gives
//! a [`MeterError`] or a [`MeterState`] with the reason.

mod cpu_time;
mod detect;
mod meter;
#[cfg(feature = "nvml")]
mod nvml;
mod plugin;
mod sampler;
mod scripted;
mod self_test;
mod simulated;
mod tracker;
mod window;

pub use cpu_time::{CpuTimeMeter, InvalidWattsPerCore};
pub use detect::{
    Adapter, AdapterKind, OpenMeterError, SurveyedMeter, detect, known_meters, open, survey,
};
pub use meter::{MeterError, MeterInfo, PowerMeter, Provenance};
#[cfg(feature = "nvml")]
pub use nvml::{BoardChoice, NvmlMeter};
pub use plugin::{
    MeterChoice, MeterFactory, MeteredPower, POWER_DIAGNOSTIC, PowerPlugin, PowerSystems,
};
pub use sampler::{PowerSampler, SamplerSettings};
pub use scripted::ScriptedMeter;
pub use self_test::{SelfTest, Verdict, busy_cpu_load, self_test};
pub use simulated::{SimulatedDevice, SimulatedMeter};
pub use tracker::{MeterState, PowerSnapshot};
pub use window::EnergyWindow;

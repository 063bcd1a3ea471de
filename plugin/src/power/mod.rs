//! Power meters, each with its provenance: what they read, which one suits this machine, and a
//! background sampler that publishes the app's power without ever making a frame wait for a
//! counter.
//!
//! | item | job |
//! |---|---|
//! | [`PowerMeter`] | contract: cumulative energy, and an honest word on where it comes from |
//! | [`CpuTimeMeter`], [`NvmlMeter`] | the meters |
//! | [`ScriptedMeter`] | a meter that says what a test tells it to |
//! | [`detect`], [`open`], [`survey`] | which meters this machine has, and which one meters the device that renders |
//! | [`self_test`] | whether a meter does what an energy counter does |
//! | [`EnergyWindow`] | energy between two moments, for measurements that own their thread |
//! | [`PowerSampler`] | power over time, polled on a thread of its own |
//! | [`PowerPlugin`] | the sampler in a Bevy app: [`MeteredPower`] and a diagnostic |
//!
//! No meter ever answers 0 W for "don't know": a counter that is absent, unreadable or broken is a
//! [`MeterError`] or a [`MeterState`], with the reason.

mod cpu_time;
mod detect;
mod meter;
#[cfg(feature = "nvml")]
mod nvml;
mod plugin;
mod sampler;
mod scripted;
mod self_test;
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
pub use tracker::{MeterState, PowerSnapshot};
pub use window::EnergyWindow;

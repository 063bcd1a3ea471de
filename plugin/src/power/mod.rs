//! Power meters with their provenance, detection of the meter that covers the rendering device, and
//! a background sampler that publishes the app's power without blocking a frame on a counter.
//!
//! | item | job |
//! |---|---|
//! | [`PowerMeter`] | contract of a meter: raw energy or power, with its provenance |
//! | [`CpuTimeMeter`]; by name, NVML's and the system's | the meters |
//! | [`detect`], [`open`] | the meters of this machine, and the one that covers the rendering device |
//! | `tracker` | the fault model, which judges the readings of every meter |
//! | [`PowerSampler`] | the one thread that reads a meter |
//! | [`PowerPlugin`] | the sampler in a Bevy app: [`MeteredPower`] and a diagnostic |
//!
//! An unknown power is never reported as 0 W: a counter that is missing, unreadable or faulty gives
//! a [`MeterError`] or a [`MeterState`] with the reason.

mod adapter;
mod battery;
mod cpu_time;
mod detect;
mod meter;
#[cfg(any(test, windows, target_os = "macos"))]
mod notebook;
#[cfg(feature = "nvml")]
mod nvml;
mod plugin;
mod root;
mod sampler;
mod sysfs;
#[cfg(test)]
mod testing;
mod tracker;

pub use adapter::{Adapter, AdapterKind};
pub(crate) use battery::Feed;
pub use cpu_time::CpuTimeMeter;
pub use detect::{detect, meters, open};
pub use meter::{Count, MeterError, MeterInfo, OpenMeterError, PowerMeter, Provenance, Reading};
#[cfg(feature = "stage")]
pub(crate) use plugin::switch_off;
pub use plugin::{MeterChoice, MeterFactory, MeteredPower, PowerPlugin, PowerSystems};
pub use sampler::{PowerSampler, SamplerSettings};
#[cfg(test)]
pub(crate) use testing::ScriptedMeter;
pub use tracker::{MeterState, PowerSnapshot};

/// In place of NVML in a build without it.
#[cfg(not(feature = "nvml"))]
mod nvml {
    use super::meter::MeterKind;

    pub(crate) const KIND: MeterKind = MeterKind {
        name: "nvml",
        usage: "nvml[=INDEX|=BOARD NAME]",
        expected: "a board's index from 0, or its name",
        open: |_, _| {
            let reason = "built without the feature `nvml`; enable it";
            Err(super::MeterError::unavailable("nvml", reason).into())
        },
    };
}

/// What feeds the machine. May take milliseconds, or hang with a driver.
pub(crate) fn feed() -> Feed {
    use battery::Cells;
    #[cfg(any(windows, target_os = "macos"))]
    let mut cells = notebook::System;
    #[cfg(not(any(windows, target_os = "macos")))]
    let mut cells = sysfs::battery::Files { root: root::SysRoot::default(), wanted: None };
    match cells.read() {
        Ok(cells) => battery::feed_of(&cells),
        // Linux' files have a charger, or no battery.
        Err(MeterError::Unavailable { .. }) => Feed::Charger,
        Err(_) if cfg!(any(windows, target_os = "macos")) => Feed::Unknown,
        Err(_) => Feed::Charger,
    }
}

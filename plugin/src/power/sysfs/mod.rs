//! Meters of handhelds and laptops: files that the Linux kernel provides under a root folder.
//!
//! | file | job |
//! |---|---|
//! | `root` | the root folder, and reading of single files with their faults |
//! | `integrate` | energy of a counter that wraps, and of a source of power, over time |
//! | `background` | a thread that polls a source, so that a file that hangs blocks nobody |
//! | `rapl`, `cards`, `gpu`, `battery`, `jetson` | the sources |
//! | `notebook` | batteries of macOS and Windows, which have no such files |
//!
//! A source knows no clock: its caller says the time of each reading. So tests play hours in
//! milliseconds, on fake trees of files.

mod background;
#[cfg_attr(any(windows, target_os = "macos"), allow(dead_code))]
pub(crate) mod battery;
mod cards;
#[cfg(test)]
pub(crate) mod fake;
pub(crate) mod gpu;
mod integrate;
pub(crate) mod jetson;
#[cfg(any(test, windows, target_os = "macos"))]
pub(crate) mod notebook;
pub(crate) mod rapl;
mod root;

use std::time::Duration;

pub(crate) use root::SysRoot;

use crate::power::detect::{MeterKind, Opened};
use crate::power::{Adapter, MeterError, MeterInfo, OpenMeterError, PowerMeter};
use crate::units::Joules;

/// A source of cumulative energy that is told the time.
pub(crate) trait Source: Send {
    /// Name, provenance and coverage.
    fn info(&self) -> MeterInfo;

    /// As [`PowerMeter::window_seconds`].
    fn window_seconds(&self) -> f64;

    /// Longest time between two readings without a loss.
    fn poll(&self) -> Duration;

    /// Energy in joules at the time `at`, which never falls; `None` while the first update of the
    /// counter is awaited. After an error the next energy has none of the time of the error.
    ///
    /// # Errors
    /// Each fault once, or as long as it lasts.
    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError>;
}

/// A kind of source: how to find it under a root.
pub(crate) struct SourceKind {
    /// Name on the command line.
    pub name: &'static str,
    /// Syntax of its argument.
    pub usage: &'static str,
    /// What its parameter is, in words.
    pub expected: &'static str,
    /// Finds it by the parameter after `=`.
    pub find: fn(&SysRoot, Option<&str>) -> Result<Box<dyn Source>, MeterError>,
    /// Finds the one that covers an adapter; an error says why none does.
    pub find_for: fn(&SysRoot, &Adapter) -> Result<Box<dyn Source>, MeterError>,
}

impl MeterKind for SourceKind {
    fn name(&self) -> &'static str {
        self.name
    }

    fn usage(&self) -> &'static str {
        self.usage
    }

    fn open(&self, root: &SysRoot, parameter: Option<&str>) -> Opened {
        if parameter == Some("") {
            return Err(OpenMeterError::Parameter {
                meter: self.name.to_owned(),
                parameter: String::new(),
                expected: self.expected.to_owned(),
            });
        }
        Ok(start((self.find)(root, parameter)?)?)
    }

    fn open_for(
        &self,
        root: &SysRoot,
        adapter: &Adapter,
    ) -> Result<Box<dyn PowerMeter>, MeterError> {
        start((self.find_for)(root, adapter)?)
    }
}

fn start(source: Box<dyn Source>) -> Result<Box<dyn PowerMeter>, MeterError> {
    Ok(Box::new(background::FileMeter::start(source)?))
}

#[cfg(test)]
#[path = "faults_tests.rs"]
mod faults_tests;

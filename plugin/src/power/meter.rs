//! What a power meter is: cumulative energy, and an honest word on where the number comes from.

use std::time::Duration;

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::units::{Joules, Watts};

/// Where watts come from. Every figure carries one.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Provenance {
    /// Read from a meter.
    Measured,
    /// Worked out from something else by a model.
    Modelled,
}

/// A meter's name, provenance, and what the reader must know of it.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct MeterInfo {
    /// Identifier, as on the command line: `nvml`, `cpu-time`…
    pub name: String,
    /// Measured or modelled.
    pub provenance: Provenance,
    /// What is covered and how it is obtained, in one line: "whole board, NVML energy counter",
    /// "process CPU time × 3.5 W per core".
    pub description: String,
}

/// Why a meter gives no number. Never is 0 W said for "don't know".
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeterError {
    /// The device, driver or counter is not there.
    #[error("{meter}: not available: {reason}")]
    Unavailable {
        /// The meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter is there but cannot be read.
    #[error("{meter}: cannot be read: {reason}")]
    Unreadable {
        /// The meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter can be read but does not do what an energy counter does.
    #[error("{meter}: broken: {reason}")]
    Broken {
        /// The meter.
        meter: String,
        /// What it did.
        reason: String,
    },
    /// The window is shorter than the counter's own step, so that its energy says nothing about
    /// power.
    #[error("{meter}: window too short: {elapsed:?}, where the counter needs {least:?}")]
    WindowTooShort {
        /// The meter.
        meter: String,
        /// Length of the window.
        elapsed: Duration,
        /// Shortest window that means something.
        least: Duration,
    },
}

impl MeterError {
    /// The device, driver or counter is not there. Name the remedy in `reason` where there is one.
    pub fn unavailable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unavailable { meter: meter.into(), reason: reason.into() }
    }

    /// The counter is there but cannot be read.
    pub fn unreadable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unreadable { meter: meter.into(), reason: reason.into() }
    }

    /// The counter can be read but does not do what an energy counter does.
    pub fn broken(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Broken { meter: meter.into(), reason: reason.into() }
    }
}

/// A source of cumulative energy.
pub trait PowerMeter: Send {
    /// Name and provenance.
    fn info(&self) -> MeterInfo;

    /// Energy since some fixed moment, never falling. Differences of two readings are what counts.
    ///
    /// # Errors
    /// When there is no reading.
    fn energy(&mut self) -> Result<Joules, MeterError>;

    /// Power that flows though the app does nothing, which [`energy`](Self::energy) does not
    /// contain. 0 where the counter covers the whole device.
    fn idle(&self) -> Watts {
        Watts(0.0)
    }

    /// The shortest window, in seconds, over which a difference of two readings means something:
    /// the counter's own step.
    fn window_seconds(&self) -> f64;
}

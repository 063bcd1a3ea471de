//! The power meter contract: cumulative energy with its provenance.

use std::time::Duration;

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

use crate::units::{Joules, Watts};

/// Provenance of a power figure.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Provenance {
    /// Read from a hardware counter.
    Measured,
    /// Computed from another quantity by a model.
    Modelled,
}

/// A meter's name, provenance and coverage.
#[derive(Clone, Debug, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct MeterInfo {
    /// Name, as on the command line: `nvml`, `cpu-time`…
    pub name: String,
    /// Measured or modelled.
    pub provenance: Provenance,
    /// Coverage and method, in one line: "whole board, NVML energy counter", "process CPU time ×
    /// 3.5 W per core".
    pub description: String,
}

/// Why a meter gives no reading. An unknown power is always an error, never 0 W.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeterError {
    /// The device, driver or counter is missing.
    #[error("{meter}: not available: {reason}")]
    Unavailable {
        /// Name of the meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter exists but cannot be read.
    #[error("{meter}: cannot be read: {reason}")]
    Unreadable {
        /// Name of the meter.
        meter: String,
        /// Why.
        reason: String,
    },
    /// The counter can be read but does not behave like an energy counter.
    #[error("{meter}: broken: {reason}")]
    Broken {
        /// Name of the meter.
        meter: String,
        /// The observed fault.
        reason: String,
    },
    /// The window is shorter than the counter's update interval, so its energy does not determine
    /// the power.
    #[error("{meter}: window too short: {elapsed:?}, but the counter needs {least:?}")]
    WindowTooShort {
        /// Name of the meter.
        meter: String,
        /// Length of the window.
        elapsed: Duration,
        /// Shortest valid window.
        least: Duration,
    },
}

impl MeterError {
    /// [`Unavailable`](Self::Unavailable): the device, driver or counter is missing. Name the
    /// remedy in `reason` where there is one.
    pub fn unavailable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unavailable { meter: meter.into(), reason: reason.into() }
    }

    /// [`Unreadable`](Self::Unreadable): the counter exists but cannot be read.
    pub fn unreadable(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Unreadable { meter: meter.into(), reason: reason.into() }
    }

    /// [`Broken`](Self::Broken): the counter can be read but does not behave like an energy
    /// counter.
    pub fn broken(meter: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Broken { meter: meter.into(), reason: reason.into() }
    }
}

/// A source of cumulative energy.
pub trait PowerMeter: Send {
    /// Name, provenance and coverage.
    fn info(&self) -> MeterInfo;

    /// Energy since an arbitrary fixed moment, in joules, monotonically increasing. Only
    /// differences of two readings are meaningful.
    ///
    /// # Errors
    /// [`MeterError`] when there is no reading.
    fn energy(&mut self) -> Result<Joules, MeterError>;

    /// Idle power that [`energy`](Self::energy) does not include, in watts; finite, at least 0. 0
    /// by default, where the counter covers the whole device.
    fn idle(&self) -> Watts {
        Watts(0.0)
    }

    /// The shortest window, in seconds, over which a difference of two readings is meaningful: the
    /// counter's update interval. Callers clamp it to 0 to 60 s; NaN counts as 1 s.
    fn window_seconds(&self) -> f64;
}

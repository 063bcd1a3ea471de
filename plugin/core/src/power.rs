//! What a power figure is and where it comes from.

use std::fmt;

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Provenance of a power figure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
#[serde(rename_all = "lowercase")]
pub enum Provenance {
    /// Read from a hardware counter.
    Measured,
    /// Computed from another quantity by a model.
    Modelled,
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Measured => "measured",
            Self::Modelled => "modelled",
        })
    }
}

/// A meter's name, provenance and coverage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
pub struct MeterInfo {
    /// Name, as on the command line: `nvml`, `cpu-time`…
    pub name: String,
    /// Measured or modelled.
    pub provenance: Provenance,
    /// Coverage and method, in one line: "whole board, NVML energy counter", "process CPU time ×
    /// 3.5 W per core".
    pub description: String,
}

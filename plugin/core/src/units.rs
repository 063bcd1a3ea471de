//! Physical units of the public interface as types, so that watts and joules cannot be confused.

use std::fmt;
use std::ops::{Add, Div, Mul, Sub};

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Power, in watts (J/s). A reading is finite and at least 0; a budget may be infinite. The type
/// accepts any number.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
#[serde(transparent)]
pub struct Watts(pub f64);

/// Energy, in joules. A meter's reading is finite. The type accepts any number.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
#[serde(transparent)]
pub struct Joules(pub f64);

impl Joules {
    /// Mean power of this energy over `seconds`. Not finite when `seconds` is 0.
    pub fn per_seconds(self, seconds: f64) -> Watts {
        Watts(self.0 / seconds)
    }
}

impl fmt::Display for Watts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.*} W", f.precision().unwrap_or(2), self.0)
    }
}

impl fmt::Display for Joules {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.*} J", f.precision().unwrap_or(2), self.0)
    }
}

macro_rules! linear_unit {
    ($($unit:ident),*) => {$(
        impl Add for $unit { type Output = Self; fn add(self, other: Self) -> Self { Self(self.0 + other.0) } }
        impl Sub for $unit { type Output = Self; fn sub(self, other: Self) -> Self { Self(self.0 - other.0) } }
        impl Mul<f64> for $unit { type Output = Self; fn mul(self, factor: f64) -> Self { Self(self.0 * factor) } }
        impl Div<f64> for $unit { type Output = Self; fn div(self, divisor: f64) -> Self { Self(self.0 / divisor) } }
    )*};
}
linear_unit!(Watts, Joules);

impl std::iter::Sum for Watts {
    fn sum<I: Iterator<Item = Self>>(powers: I) -> Self {
        Self(powers.map(|power| power.0).sum())
    }
}

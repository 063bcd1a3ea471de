//! A kind of meter: how it is named and opened.

use crate::power::root::SysRoot;
use crate::power::{Adapter, MeterError, PowerMeter};

/// Why no meter was opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OpenMeterError {
    /// No meter has this name.
    #[error("there is no power meter called \"{name}\"; known: {}", known.join(", "))]
    UnknownName {
        /// The requested name.
        name: String,
        /// Syntax of each meter's argument to [`open`](crate::power::open).
        known: Vec<&'static str>,
    },
    /// The part after `=` is invalid for this meter.
    #[error("{meter}: \"{parameter}\" is not a valid parameter: {expected}")]
    Parameter {
        /// Name of the meter.
        meter: String,
        /// The text after `=`.
        parameter: String,
        /// The valid parameters, in words.
        expected: String,
    },
    /// The meter is known but gives no reading on this machine.
    #[error(transparent)]
    Meter(#[from] MeterError),
    /// No meter covers the rendering device.
    #[error("no power meter for this adapter: {}", reasons.join("; "))]
    NoneSuits {
        /// One reason per meter, in the order tried.
        reasons: Vec<String>,
    },
}

/// A meter that was opened.
pub(crate) type Opened = Result<Box<dyn PowerMeter>, OpenMeterError>;

/// Which device a meter shall be of.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wanted<'a> {
    /// The only one, or the usual one.
    Usual,
    /// The one that the text after `=` names.
    Named(&'a str),
    /// The one that renders. An error says why none covers it.
    For(&'a Adapter),
}

/// A kind of meter.
pub(crate) struct MeterKind {
    /// Name, as [`open`](crate::power::open) accepts it.
    pub name: &'static str,
    /// Syntax of its argument to [`open`](crate::power::open).
    pub usage: &'static str,
    /// What the text after `=` is, in words.
    pub expected: &'static str,
    /// Opens it.
    pub open: fn(&SysRoot, Wanted) -> Opened,
}

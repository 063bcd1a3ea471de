//! Why a list of knobs is not a valid space, or a text not valid settings.

use super::SEPARATOR;
use crate::knobs::KnobLevels;
use crate::knobs::suggestion::did_you_mean;

/// Why a list of knobs is not a valid space, or a text not valid settings.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KnobSpaceError {
    /// More knobs than [`KnobLevels`] can pack.
    #[error("{0} knobs, but settings pack at most {max}: leave some out", max = KnobLevels::MAX_KNOBS)]
    TooManyKnobs(usize),
    /// No level, too many levels, or a value that is not finite.
    #[error("knob `{0}` must have 1 to {max} levels with finite values", max = KnobLevels::MAX_LEVELS)]
    BadLevels(String),
    /// Two knobs with the same name.
    #[error("knob `{0}` appears twice")]
    Duplicate(String),
    /// A name that is not a knob of the space.
    #[error("unknown knob `{name}`: {}the knobs here are {known}", did_you_mean(name, known.split(SEPARATOR)))]
    Unknown {
        /// The name as given.
        name: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// A label that is not a level of the knob.
    #[error("knob `{knob}` has no level `{level}`: {}its levels are {known}", did_you_mean(level, known.split(SEPARATOR)))]
    UnknownLevel {
        /// The knob.
        knob: String,
        /// The level as given.
        level: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// Text other than `knob=level`, `max` or `min`.
    #[error("`{0}` is not of the form knob=level, nor one of `max` and `min`")]
    NotAnAssignment(String),
}

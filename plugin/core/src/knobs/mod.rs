//! Quality knobs: the available knobs ([`KnobSpace`]) and one level for each ([`KnobLevels`]).

mod knob;
mod levels;
mod space;

pub use knob::{DependsOn, Knob, Level};
pub use levels::KnobLevels;
pub use space::{KnobSpace, KnobSpaceError, did_you_mean};

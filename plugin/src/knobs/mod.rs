//! Quality knobs: the available knobs ([`KnobSpace`]), a camera's levels ([`KnobSettings`]), and
//! the drivers that apply a level ([`KnobDriver`]).
//!
//! To add a knob, write a [`FieldKnob`] or a [`KnobDriver`] and register it with
//! [`RegisterKnob::register_knob`]; the built-in ones are listed in `builtin/mod.rs`.
//! [`WarmKnobs`] shows all levels behind a loading screen, so that no later switch waits for a
//! shader compiler.

mod builtin;
mod driver;
mod field;
mod overrides;
mod plugin;
mod reconcile;
mod settings;
mod warm;

pub use crate::schedule::KnobSystems;
pub use frugal_core::knobs::*;

pub(crate) use builtin::allow_authored;
pub use driver::{KnobDriver, KnobRegistry, KnobScope, KnownKnobs, RegisterKnob};
pub use field::{FieldKnob, KnobField};
pub use plugin::KnobPlugin;
pub use settings::{AppliedKnobs, KnobSettings};
pub use warm::WarmKnobs;

//! Quality knobs: the available knobs ([`KnobSpace`]), a camera's levels ([`KnobSettings`]), and
//! the drivers that apply a level ([`KnobDriver`]).
//!
//! To add a knob, write a [`KnobDriver`] and register it with [`RegisterKnob::register_knob`]; the
//! built-in ones are one file each under `builtin/` and are listed in one place, [`KnobPlugin`].
//! [`WarmKnobs`] shows all levels behind a loading screen, so that no later switch waits for a
//! shader compiler.

mod apply;
mod builtin;
mod driver;
mod known;
mod reconcile;
mod settings;
mod warm;

pub use crate::schedule::KnobSystems;
pub use apply::KnobPlugin;
pub(crate) use builtin::allow_authored;
pub use driver::{KnobDriver, KnobRegistry, KnobScope, RegisterKnob};
pub use frugal_core::knobs::*;
pub use known::KnownKnobs;
pub use reconcile::AppliedKnobs;
pub use settings::KnobSettings;
pub use warm::WarmKnobs;

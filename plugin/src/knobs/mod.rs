//! Quality knobs: what can be set ([`KnobSpace`]) and how a level reaches a camera.
mod space;
pub use space::{Knob, KnobSpace, KnobSpaceError, Level, Need, RenderSettings};

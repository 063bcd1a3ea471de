//! Quality knobs: what can be set ([`KnobSpace`]) and how a level reaches a camera.
mod settings;
mod space;
pub use settings::KnobSettings;
pub use space::{Knob, KnobSpace, KnobSpaceError, Level, Need, RenderSettings};

//! The settings of one camera.

use std::sync::Arc;

use bevy::ecs::component::Component;

use super::{KnobSpace, RenderSettings};

/// What is applied to a camera: one level per knob of a space.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct KnobSettings {
    /// The knobs that `settings` sets; the others stay as they are.
    pub space: Arc<KnobSpace>,
    /// Their levels.
    pub settings: RenderSettings,
}

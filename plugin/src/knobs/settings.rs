//! The settings of one camera.

use std::sync::Arc;

use bevy::ecs::prelude::*;

use super::{KnobSpace, RenderSettings};

/// The levels at which this camera's knobs stand, applied whenever they change. Set by hand, or by
/// the controller.
///
/// Knobs that `space` leaves out stay as the app has set them.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct KnobSettings {
    /// What the bits of `settings` mean.
    pub space: Arc<KnobSpace>,
    /// One level per knob of `space`.
    pub settings: RenderSettings,
}

//! The settings of one camera.

use std::sync::Arc;

use bevy::ecs::prelude::*;

use super::{KnobLevels, KnobSpace};

/// The levels of this camera's knobs, applied whenever they change. Set by the app, or by the
/// controller.
///
/// Knobs outside `space` keep the app's own setting.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct KnobSettings {
    /// The knobs that `settings` refers to.
    pub space: Arc<KnobSpace>,
    /// One level per knob of `space`. A level beyond a knob's last counts as the last.
    pub settings: KnobLevels,
}

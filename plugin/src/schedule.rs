//! System sets that more than one part of the plugin orders its systems by.

use bevy::ecs::prelude::*;

/// Where settings are applied.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum KnobSystems {
    /// In `PostUpdate`, before cameras are updated: a level set before it is in the frame's image.
    Apply,
}

//! The time that a frame's work takes.

use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

/// The time that a frame's work takes, for budgets of frame time.
///
/// Without the app's own figure it is the time from frame to frame, less what
/// [`FrameRateLimit`](crate::pacing::FrameRateLimit) waits. A frame of more than 0.25 s counts from the
/// third in succession, and one of more than 4 s never: the app loads, or waits for events. With
/// vertical synchronisation the time is never less than the display's interval, whatever the work:
/// write the GPU's time then.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct FrameTime {
    /// The last frame's work, in seconds; above 0 and finite. `None`: the time from frame to frame.
    /// Default: `None`.
    pub seconds: Option<f64>,
}

impl FrameTime {
    /// The app's own figure, if it is valid.
    pub(crate) fn valid(&self) -> Option<f64> {
        self.seconds.filter(|seconds| *seconds > 0.0 && seconds.is_finite())
    }
}

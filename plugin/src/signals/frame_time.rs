//! The time that a frame's work takes.

use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

/// Longest frame that counts, in seconds: loading says nothing about a frame's work.
const MAX_SECONDS: f64 = 0.25;

/// The time that a frame's work takes, for budgets of frame time.
///
/// Without the app's own figure it is the time from frame to frame. With vertical synchronisation
/// that is never less than the display's interval, whatever the work: write the GPU's time then.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct FrameTime {
    /// The last frame's work, in seconds; above 0, at most 0.25. `None`: the time from frame to
    /// frame. Default: `None`.
    pub seconds: Option<f64>,
}

impl FrameTime {
    /// The valid figure of a frame that took `delta_seconds`; `None` if neither is one.
    pub(crate) fn valid(&self, delta_seconds: f64) -> Option<f64> {
        let seconds = self.seconds.unwrap_or(delta_seconds);
        (seconds > 0.0 && seconds <= MAX_SECONDS).then_some(seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_apps_figure_goes_first_and_pauses_count_as_unknown() {
        assert_eq!(FrameTime::default().valid(0.016), Some(0.016));
        assert_eq!(FrameTime { seconds: Some(0.008) }.valid(0.016), Some(0.008));
        for odd in [f64::NAN, f64::INFINITY, -0.01, 0.0, 3.0] {
            assert_eq!(FrameTime { seconds: Some(odd) }.valid(0.016), None, "{odd}");
            assert_eq!(FrameTime::default().valid(odd), None, "{odd}");
        }
    }
}

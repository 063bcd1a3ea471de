//! Frame-rate cap: the most effective power knob where the display allows it.

mod deadline;

use std::time::Duration;

use bevy::app::{App, Last, Plugin};
use bevy::ecs::prelude::*;
use bevy::ecs::reflect::ReflectResource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use deadline::Deadline;

/// Highest number of frames per second; `None`, the default, is no limit. Lower values save power
/// in proportion and make motion less smooth.
///
/// The app sleeps at the end of each frame, so a display with vertical synchronization shows such
/// rates evenly only if they divide its own. Limits that are not above 0 or not finite are none.
/// Without effect in a browser, which paces frames itself.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct FrameRateLimit(pub Option<f64>);

/// How long the app waited at the end of the last frame.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub(crate) struct FrameWait(pub(crate) Duration);

/// Adds [`FrameRateLimit`] and keeps it.
#[derive(Clone, Copy, Debug, Default)]
pub struct FramePacingPlugin;

impl Plugin for FramePacingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<FrameRateLimit>()
            .init_resource::<FrameWait>()
            .register_type::<FrameRateLimit>()
            .add_systems(Last, keep_frame_rate.run_if(is_limited));
    }
}

/// Whether there is a limit, or was one in the last frame.
fn is_limited(limit: Res<FrameRateLimit>) -> bool {
    limit.0.is_some() || limit.is_changed()
}

fn keep_frame_rate(
    limit: Res<FrameRateLimit>,
    mut waited: ResMut<FrameWait>,
    mut deadline: Local<Deadline>,
) {
    waited.0 = Duration::ZERO;
    #[cfg(not(target_arch = "wasm32"))]
    {
        let start = bevy::platform::time::Instant::now();
        if let Some(wait) = deadline.next(limit.0, start) {
            std::thread::sleep(wait);
            waited.0 = start.elapsed();
        }
    }
    #[cfg(target_arch = "wasm32")]
    let _ = (limit, &mut *deadline);
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn frames_take_at_least_their_time() {
        let mut app = App::new();
        app.add_plugins(FramePacingPlugin).insert_resource(FrameRateLimit(Some(200.0)));
        app.update();
        let start = Instant::now();
        (0..10).for_each(|_| app.update());
        // Sleeping may take longer on a busy machine, but never less.
        assert!(start.elapsed() >= Duration::from_millis(45), "{:?}", start.elapsed());
    }
}

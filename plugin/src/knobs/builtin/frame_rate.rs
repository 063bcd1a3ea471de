//! Frames per second. App scope, opt-in.

use bevy::ecs::prelude::*;

use crate::knobs::{Knob, KnobDriver, KnobScope, Level};
use crate::pacing::FrameRateLimit;

/// 30, 40, 60, 90 or 120 frames per second, or no limit. Power grows with the frame rate, motion
/// gets smoother. Opt-in, since the error of a still image does not see it.
pub(crate) struct FrameRate;

/// Value of the level without a limit. Knobs have finite values.
const UNLIMITED: f64 = 1e6;

/// The app's own limit, while the knob holds it.
#[derive(Resource, Clone, Copy)]
struct HeldLimit {
    authored: FrameRateLimit,
    written: FrameRateLimit,
}

impl HeldLimit {
    fn authored(world: &World, current: FrameRateLimit) -> FrameRateLimit {
        match world.get_resource::<Self>() {
            Some(held) if held.written == current => held.authored,
            _ => current,
        }
    }
}

impl KnobDriver for FrameRate {
    fn knob(&self) -> Knob {
        let rates = [30, 40, 60, 90, 120].map(|rate| (f64::from(rate), rate.to_string()));
        let unlimited = (UNLIMITED, "unlimited".to_owned());
        Knob::labelled("frame_rate", rates.into_iter().chain([unlimited]))
    }

    fn scope(&self) -> KnobScope {
        KnobScope::App
    }

    fn is_opt_in(&self) -> bool {
        true
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        let Some(current) = world.get_resource::<FrameRateLimit>().copied() else { return };
        let authored = HeldLimit::authored(world, current);
        let limit = (level.value < UNLIMITED).then_some(level.value);
        // The app's own limit is the highest that the knob may reach.
        let limit = match (limit, authored.0) {
            (Some(level), Some(own)) => Some(level.min(own)),
            (limit, own) => limit.or(own),
        };
        let written = FrameRateLimit(limit);
        world.insert_resource(written);
        world.insert_resource(HeldLimit { authored, written });
    }

    fn is_applied(&self, world: &World, _: Entity, _: &Level) -> bool {
        match (world.get_resource::<FrameRateLimit>(), world.get_resource::<HeldLimit>()) {
            (Some(current), Some(held)) => *current == held.written,
            _ => true,
        }
    }

    fn release(&self, world: &mut World, _: Entity) {
        let Some(current) = world.get_resource::<FrameRateLimit>().copied() else { return };
        let authored = HeldLimit::authored(world, current);
        world.insert_resource(authored);
        world.remove_resource::<HeldLimit>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_apps_own_limit_bounds_the_knob_and_comes_back() {
        let mut world = World::new();
        let camera = world.spawn_empty().id();
        let levels = FrameRate.knob().levels;
        let limit = |world: &World| world.get_resource::<FrameRateLimit>().and_then(|it| it.0);
        FrameRate.apply(&mut world, camera, &levels[0]);
        assert_eq!(limit(&world), None, "an app without pacing is left alone");
        world.insert_resource(FrameRateLimit(Some(60.0)));
        let limits: Vec<_> = levels
            .iter()
            .map(|level| {
                FrameRate.apply(&mut world, camera, level);
                limit(&world)
            })
            .collect();
        assert_eq!(limits, [30.0, 40.0, 60.0, 60.0, 60.0, 60.0].map(Some));
        FrameRate.apply(&mut world, camera, &levels[1]);
        world.insert_resource(FrameRateLimit(None));
        assert!(!FrameRate.is_applied(&world, camera, &levels[1]));
        FrameRate.apply(&mut world, camera, &levels[1]);
        assert_eq!(limit(&world), Some(40.0));
        FrameRate.release(&mut world, camera);
        assert_eq!(limit(&world), None);
    }
}

//! Rendered size as a fraction of the target's.

use bevy::ecs::prelude::*;

use crate::knobs::{Knob, KnobDriver, Level};
use crate::resolution::ResolutionScale;

/// 50 to 100 % of the width and height. Higher levels are sharper; the cost grows with the square.
pub(crate) struct ResolutionScaleKnob;

impl KnobDriver for ResolutionScaleKnob {
    fn knob(&self) -> Knob {
        Knob::labelled(
            "resolution_scale",
            [50, 60, 70, 80, 90, 100]
                .map(|percent| (f64::from(percent) / 100.0, format!("{percent}%"))),
        )
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        world.entity_mut(camera).insert(ResolutionScale(level.value as f32));
    }
}

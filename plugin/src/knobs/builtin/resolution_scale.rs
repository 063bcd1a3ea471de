//! Rendered size as a fraction of the target's.

use bevy::ecs::prelude::*;

use super::held::{self, Authored};
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
        held::hold(world, camera, |_| Some(ResolutionScale(level.value as f32)));
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<ResolutionScale>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<ResolutionScale>(world, camera);
    }
}

impl Authored for ResolutionScale {
    fn is_same(&self, other: &Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

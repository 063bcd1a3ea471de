//! Mip bias of texture sampling.

use bevy::ecs::prelude::*;
use bevy::render::camera::MipBias;

use super::held::{self, Authored};
use crate::knobs::{Knob, KnobDriver, Level};

/// Mip bias +2 to 0 levels. A higher bias is blurrier and saves bandwidth, but not memory: the
/// finer mip levels stay resident.
pub(crate) struct TextureDetail;

impl KnobDriver for TextureDetail {
    fn knob(&self) -> Knob {
        // The value is the negated bias, so that it increases with quality like every other knob's.
        Knob::labelled("texture_detail", [(-2.0, "+2"), (-1.0, "+1"), (-0.5, "+0.5"), (0.0, "0")])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        held::hold(world, camera, |_| Some(MipBias(-level.value as f32)));
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<MipBias>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<MipBias>(world, camera);
    }
}

impl Authored for MipBias {
    fn is_same(&self, other: &Self) -> bool {
        // Equal bits: NaN from the app must not look overwritten in every frame.
        self.0.to_bits() == other.0.to_bits()
    }
}

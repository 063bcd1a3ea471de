//! Mip bias of texture sampling.

use bevy::ecs::prelude::*;
use bevy::render::camera::MipBias;

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
        world.entity_mut(camera).insert(MipBias(-level.value as f32));
    }
}

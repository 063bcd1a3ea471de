//! Samples per pixel of Bevy's screen-space ambient occlusion.

use bevy::ecs::prelude::*;
use bevy::pbr::{ScreenSpaceAmbientOcclusion, ScreenSpaceAmbientOcclusionQualityLevel};

use super::held::{self, Authored};
use crate::knobs::{Knob, KnobDriver, Level};

/// Off, 4, 8, 16 or 32 samples per pixel, on a camera to which the app gave
/// [`ScreenSpaceAmbientOcclusion`]. Higher levels reduce noise and cost more GPU time.
/// Switching between off and on changes the deferred lighting pipeline: Bevy skips that pass until
/// the pipeline is compiled.
pub(crate) struct AmbientOcclusion;

/// Each slice takes two samples on each side.
const SAMPLES_PER_SLICE: u32 = 4;

impl KnobDriver for AmbientOcclusion {
    fn knob(&self) -> Knob {
        Knob::labelled(
            "ambient_occlusion",
            [(0.0, "off"), (4.0, "4"), (8.0, "8"), (16.0, "16"), (32.0, "32")],
        )
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let slice_count = level.value as u32 / SAMPLES_PER_SLICE;
        let quality_level = ScreenSpaceAmbientOcclusionQualityLevel::Custom {
            slice_count,
            samples_per_slice_side: 2,
        };
        held::hold(world, camera, |authored: Option<&ScreenSpaceAmbientOcclusion>| {
            // Bevy's own normal prepass of it stays while it is off: switching does not change the
            // prepass, which would recompile every mesh's pipeline.
            let authored = authored.filter(|_| slice_count > 0)?;
            Some(ScreenSpaceAmbientOcclusion { quality_level, ..authored.clone() })
        });
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<ScreenSpaceAmbientOcclusion>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<ScreenSpaceAmbientOcclusion>(world, camera);
    }
}

impl Authored for ScreenSpaceAmbientOcclusion {
    fn is_same(&self, other: &Self) -> bool {
        self == other
    }

    fn take_back(&mut self, written: &Self, authored: &Self) {
        if self.quality_level == written.quality_level {
            self.quality_level = authored.quality_level;
        }
    }
}

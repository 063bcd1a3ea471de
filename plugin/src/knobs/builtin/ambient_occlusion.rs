//! Samples per pixel of Bevy's screen-space ambient occlusion.

use bevy::core_pipeline::prepass::NormalPrepass;
use bevy::ecs::prelude::*;
use bevy::pbr::{ScreenSpaceAmbientOcclusion, ScreenSpaceAmbientOcclusionQualityLevel};

use crate::knobs::{Knob, KnobDriver, Level};

/// Off, 4, 8, 16 or 32 samples per pixel. Higher levels reduce noise and cost more GPU time.
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
        let mut camera = world.entity_mut(camera);
        // Kept at every level, so that switching does not change the prepass, which would recompile
        // every mesh's pipeline.
        if !camera.contains::<NormalPrepass>() {
            camera.insert(NormalPrepass);
        }
        let slice_count = level.value as u32 / SAMPLES_PER_SLICE;
        if slice_count == 0 {
            camera.remove::<ScreenSpaceAmbientOcclusion>();
            return;
        }
        let quality_level = ScreenSpaceAmbientOcclusionQualityLevel::Custom {
            slice_count,
            samples_per_slice_side: 2,
        };
        match camera.get_mut::<ScreenSpaceAmbientOcclusion>() {
            Some(mut occlusion) => occlusion.quality_level = quality_level,
            None => {
                camera.insert(ScreenSpaceAmbientOcclusion { quality_level, ..Default::default() });
            }
        }
    }
}

//! Morphological antialiasing.

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::{Smaa, SmaaPreset};
use bevy::ecs::prelude::*;

use crate::knobs::{Knob, KnobDriver, Level};

/// Off, FXAA, or SMAA with 4 to 32 search steps. Levels are in order of quality, not cost: on some
/// devices FXAA costs more than SMAA, which processes edges only. A search then finds FXAA
/// dominated and never selects it.
pub(crate) struct Antialiasing;

const FXAA: f64 = 1.0;

impl KnobDriver for Antialiasing {
    fn knob(&self) -> Knob {
        let levels = [
            (0.0, "off"),
            (FXAA, "FXAA"),
            (4.0, "SMAA 4"),
            (8.0, "SMAA 8"),
            (16.0, "SMAA 16"),
            (32.0, "SMAA 32"),
        ];
        Knob::labelled("antialiasing", levels)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let mut camera = world.entity_mut(camera);
        let preset = match level.value as u32 {
            0 | 1 => None,
            4 => Some(SmaaPreset::Low),
            8 => Some(SmaaPreset::Medium),
            16 => Some(SmaaPreset::High),
            _ => Some(SmaaPreset::Ultra),
        };
        match preset {
            Some(preset) => {
                camera.remove::<Fxaa>().insert(Smaa { preset });
            }
            None if level.value == FXAA => {
                camera.remove::<Smaa>().insert(Fxaa::default());
            }
            None => {
                camera.remove::<(Smaa, Fxaa)>();
            }
        }
    }
}

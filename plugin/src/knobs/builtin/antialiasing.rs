//! Morphological antialiasing.

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::{Smaa, SmaaPreset};
use bevy::ecs::prelude::*;

use super::held::{self, Authored};
use crate::knobs::{Knob, KnobDriver, Level};

/// Off, FXAA, or SMAA with 4 to 32 search steps, on a camera to which the app gave either. Levels are in order of quality, not cost: on some
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
        let preset = match level.value as u32 {
            0 | 1 => None,
            4 => Some(SmaaPreset::Low),
            8 => Some(SmaaPreset::Medium),
            16 => Some(SmaaPreset::High),
            _ => Some(SmaaPreset::Ultra),
        };
        let fxaa = held::authored::<Fxaa>(world, camera);
        let is_authored = fxaa.is_some() || held::authored::<Smaa>(world, camera).is_some();
        held::hold(world, camera, |_| preset.filter(|_| is_authored).map(|preset| Smaa { preset }));
        let is_fxaa = is_authored && level.value == FXAA;
        held::hold(world, camera, |authored: Option<&Fxaa>| {
            is_fxaa.then(|| authored.cloned().unwrap_or_default())
        });
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<Smaa>(world, camera) && held::is_held::<Fxaa>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<Smaa>(world, camera);
        held::release::<Fxaa>(world, camera);
    }
}

impl Authored for Smaa {
    fn is_same(&self, other: &Self) -> bool {
        self.preset == other.preset
    }
}

impl Authored for Fxaa {
    fn is_same(&self, other: &Self) -> bool {
        self.enabled == other.enabled
            && self.edge_threshold == other.edge_threshold
            && self.edge_threshold_min == other.edge_threshold_min
    }
}

//! Three knobs over [`FrugalGi`]. A camera without it is left alone.
//!
//! Switching the count or the fraction takes a pipeline of its own, compiled at first use; the resolution reallocates the maps.

use bevy::ecs::prelude::*;

use crate::gi::{FrugalGi, GiPixelFraction};
use crate::knobs::{Knob, KnobDriver, Level};

fn change(world: &mut World, camera: Entity, change: impl FnOnce(&mut FrugalGi)) {
    if let Some(mut gi) = world.get_mut::<FrugalGi>(camera) {
        change(&mut gi);
    }
}

/// Virtual point lights: 0 is GI off.
pub struct GiVplCount;

impl KnobDriver for GiVplCount {
    fn knob(&self) -> Knob {
        Knob::new("gi_vpl_count", [0.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.vpl_count = level.value as u32);
    }
}

/// Share of pixels at which indirect light is gathered.
pub struct GiPixelShare;

impl KnobDriver for GiPixelShare {
    fn knob(&self) -> Knob {
        let levels = GiPixelFraction::ALL.map(|fraction| (fraction.share(), format!("1/{}", fraction.share().recip())));
        Knob::labelled("gi_pixel_fraction", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let fraction = GiPixelFraction::ALL.into_iter().find(|fraction| fraction.share() >= level.value).unwrap_or(GiPixelFraction::Full);
        change(world, camera, |gi| gi.pixel_fraction = fraction);
    }
}

/// Texels along the edge of each reflective shadow map.
pub struct RsmResolution;

impl KnobDriver for RsmResolution {
    fn knob(&self) -> Knob {
        Knob::new("rsm_resolution", [64.0, 128.0, 256.0, 512.0]).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.rsm_resolution = level.value as u32);
    }
}

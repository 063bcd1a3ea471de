//! Knobs over [`FrugalGi`]. A camera without it is left alone.
//!
//! Switching the fraction takes a pipeline of its own for the composite, compiled at first use; the
//! resolution reallocates the maps.

use bevy::ecs::prelude::*;

use crate::gi::{FrugalGi, GiInterleave, GiPixelFraction, GiVisibility};
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
        Knob::new("gi_vpl_count", [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.vpl_count = level.value as u32);
    }
}

/// Share of pixels at which indirect light is gathered.
pub struct GiPixelShare;

impl KnobDriver for GiPixelShare {
    fn knob(&self) -> Knob {
        let levels = GiPixelFraction::ALL
            .map(|fraction| (fraction.share(), format!("1/{}", fraction.share().recip())));
        Knob::labelled("gi_pixel_fraction", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let fraction = GiPixelFraction::ALL
            .into_iter()
            .find(|fraction| fraction.share() >= level.value)
            .unwrap_or(GiPixelFraction::Full);
        change(world, camera, |gi| gi.pixel_fraction = fraction);
    }
}

/// How many pixels share the VPLs out among them. Without sharing, the most VPLs that a pixel can
/// evaluate would be the most that there are: fewer than at the level before it, and no nearer the
/// truth. So that is no level.
pub struct GiInterleaving;

impl GiInterleaving {
    const LEVELS: [GiInterleave; 3] = [GiInterleave::Eight, GiInterleave::Four, GiInterleave::Two];
}

impl KnobDriver for GiInterleaving {
    fn knob(&self) -> Knob {
        let levels =
            Self::LEVELS.map(|level| (f64::from(level.side()), format!("{0}x{0}", level.side())));
        Knob::labelled("gi_interleave", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let found =
            Self::LEVELS.into_iter().find(|interleave| f64::from(interleave.side()) <= level.value);
        change(world, camera, |gi| gi.interleave = found.unwrap_or(GiInterleave::Two));
    }
}

/// Rays between surfaces and VPLs.
pub struct GiRays;

impl KnobDriver for GiRays {
    fn knob(&self) -> Knob {
        let levels = GiVisibility::ALL
            .map(|level| (f64::from(level.rays()), format!("{level:?}").to_lowercase()));
        Knob::labelled("gi_visibility", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let found = GiVisibility::ALL
            .into_iter()
            .find(|visibility| f64::from(visibility.rays()) >= level.value);
        change(world, camera, |gi| gi.visibility = found.unwrap_or(GiVisibility::Fine));
    }
}

/// Times that light of lamps is reflected. By name only: with more bounces all of a picture is
/// lighter, and how near the cheaper settings of the other knobs come to one bounce would drown in
/// that.
pub struct GiBounces;

impl KnobDriver for GiBounces {
    fn knob(&self) -> Knob {
        Knob::new("gi_bounces", [1.0, 2.0, 3.0]).needing("gi_visibility", 1)
    }

    fn is_by_name_only(&self) -> bool {
        true
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.bounces = level.value as u32);
    }
}

/// Samples of the sky, where the camera has an environment map: 0 leaves it to Bevy, unshadowed.
pub struct GiEnvironmentSamples;

impl KnobDriver for GiEnvironmentSamples {
    fn knob(&self) -> Knob {
        // Which takes virtual point lights in its turn.
        Knob::new("gi_environment_samples", [0.0, 8.0, 16.0, 32.0]).needing("gi_visibility", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.environment_samples = level.value as u32);
    }
}

/// Texels along the edge of each reflective shadow map.
pub struct RsmResolution;

impl KnobDriver for RsmResolution {
    fn knob(&self) -> Knob {
        // 512 was a level: of all combinations with it in four scenes one was not beaten by
        // another, and it cost 1.9 to 2.8 times as much for errors within 6 % of those at 256.
        Knob::new("rsm_resolution", [64.0, 128.0, 256.0]).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.rsm_resolution = level.value as u32);
    }
}

/// Frames from one rendering of the maps to the next, while something moves.
pub struct GiRefreshPeriod;

impl KnobDriver for GiRefreshPeriod {
    fn knob(&self) -> Knob {
        // By its frequency, since levels rise with quality.
        let levels = [8u32, 4, 2, 1].map(|period| (1.0 / f64::from(period), period.to_string()));
        Knob::labelled("gi_refresh_period", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.refresh_period = level.value.recip().round() as u32);
    }
}

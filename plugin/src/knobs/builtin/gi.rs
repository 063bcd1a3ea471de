//! Knobs over the fields of [`FrugalGi`]. A camera without that component is not changed.
//!
//! Each pixel fraction has its own composite pipeline, compiled at first use; a switch of the RSM
//! resolution reallocates the maps.

use bevy::ecs::prelude::*;

use crate::gi::{FrugalGi, GiInterleave, GiPixelFraction, GiVisibility};
use crate::knobs::{Knob, KnobDriver, Level};

fn change(world: &mut World, camera: Entity, change: impl FnOnce(&mut FrugalGi)) {
    if let Some(mut gi) = world.get_mut::<FrugalGi>(camera) {
        change(&mut gi);
    }
}

/// Virtual point lights (VPLs) per image; 0 turns GI off. Higher levels reduce noise; every
/// gathered pixel evaluates its interleaved share of them.
pub(crate) struct GiVplCount;

impl KnobDriver for GiVplCount {
    fn knob(&self) -> Knob {
        Knob::new("gi_vpl_count", [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.vpl_count = level.value as u32);
    }
}

/// Share of pixels at which indirect light is gathered. Higher levels keep finer indirect detail,
/// at proportional cost.
pub(crate) struct GiPixelShare;

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

/// Side of the square of pixels that divides the VPLs among its pixels. A narrower square gives
/// more detail at edges, at a cost that grows with the inverse of its area.
///
/// There is no level without interleaving: it would limit the VPLs of the image to the maximum per
/// pixel, fewer than at the level before it, and would come no closer to the reference.
pub(crate) struct GiInterleaving;

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

/// Visibility rays between surfaces and VPLs. Higher levels reduce noise in indirect shadows and
/// trace more rays.
pub(crate) struct GiRays;

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

/// Number of diffuse bounces; emissive surfaces and the sky get one fewer. Higher levels brighten
/// indirectly lit areas and trace more rays. Opt-in: more bounces brighten the whole image, and
/// that difference would mask the errors of the other knobs' cheaper levels.
pub(crate) struct GiBounces;

impl KnobDriver for GiBounces {
    fn knob(&self) -> Knob {
        Knob::new("gi_bounces", [1.0, 2.0, 3.0]).needing("gi_visibility", 1)
    }

    fn is_opt_in(&self) -> bool {
        true
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.bounces = level.value as u32);
    }
}

/// Environment-map samples per gathered pixel, where the camera has an environment map. Higher
/// levels reduce noise in the sky's shadows, at proportional cost. 0 leaves the diffuse light to
/// Bevy, unshadowed.
pub(crate) struct GiEnvironmentSamples;

impl KnobDriver for GiEnvironmentSamples {
    fn knob(&self) -> Knob {
        // Visibility in turn needs VPLs.
        Knob::new("gi_environment_samples", [0.0, 8.0, 16.0, 32.0]).needing("gi_visibility", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.environment_samples = level.value as u32);
    }
}

/// Texels along the edge of each reflective shadow map. Higher levels capture smaller lit features;
/// the cost of rasterisation grows with the square.
pub(crate) struct RsmResolution;

impl KnobDriver for RsmResolution {
    fn knob(&self) -> Knob {
        // 512 was rejected: in four scenes a single combination with it was non-dominated, and it
        // cost 1.9 to 2.8 times as much for errors within 6 % of those at 256.
        Knob::new("rsm_resolution", [64.0, 128.0, 256.0]).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.rsm_resolution = level.value as u32);
    }
}

/// Period of reflective shadow map rendering, in frames, while the scene changes. Shorter periods
/// lag less and cost more; 1 never lags.
pub(crate) struct GiRefreshPeriod;

impl KnobDriver for GiRefreshPeriod {
    fn knob(&self) -> Knob {
        // The value is the frequency, so that it increases with quality.
        let levels = [8u32, 4, 2, 1].map(|period| (1.0 / f64::from(period), period.to_string()));
        Knob::labelled("gi_refresh_period", levels).needing("gi_vpl_count", 1)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        change(world, camera, |gi| gi.refresh_period = level.value.recip().round() as u32);
    }
}

//! Knobs of global illumination: fields of a camera's [`FrugalGi`].

use bevy::ecs::prelude::*;

use crate::gi::{FrugalGi, GiInterleave, GiPixelFraction, GiVisibility};
use crate::knobs::{Knob, KnobDriver, Level};

/// A knob of one field.
pub(crate) struct GiKnob<T> {
    knob: fn() -> Knob,
    is_opt_in: bool,
    read: fn(&FrugalGi) -> T,
    write: fn(&mut FrugalGi, T),
    /// The field's value at a level.
    value: fn(&Level) -> T,
}

/// The authored values of all fields, and those that knobs wrote last.
#[derive(Component, Clone)]
pub(super) struct HeldGi {
    authored: FrugalGi,
    written: FrugalGi,
}

impl<T: PartialEq + Copy + 'static> KnobDriver for GiKnob<T> {
    fn knob(&self) -> Knob {
        (self.knob)()
    }

    fn is_opt_in(&self) -> bool {
        self.is_opt_in
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let Some(current) = world.get::<FrugalGi>(camera).cloned() else { return };
        let held = world.get::<HeldGi>(camera).cloned();
        let mut held =
            held.unwrap_or_else(|| HeldGi { authored: current.clone(), written: current.clone() });
        let (now, wanted) = ((self.read)(&current), (self.value)(level));
        if now != (self.read)(&held.written) {
            // The app wrote it since.
            (self.write)(&mut held.authored, now);
        }
        (self.write)(&mut held.written, wanted);
        world.entity_mut(camera).insert(held);
        self.set(world, camera, wanted);
    }

    fn is_applied(&self, world: &World, camera: Entity, level: &Level) -> bool {
        world.get::<FrugalGi>(camera).is_none_or(|gi| (self.read)(gi) == (self.value)(level))
    }

    fn release(&self, world: &mut World, camera: Entity) {
        let Some(now) = world.get::<FrugalGi>(camera).map(self.read) else { return };
        let Some(mut held) = world.get_mut::<HeldGi>(camera) else { return };
        let authored = (self.read)(&held.authored);
        let is_ours = now == (self.read)(&held.written);
        (self.write)(&mut held.written, authored);
        if is_ours {
            self.set(world, camera, authored);
        }
    }
}

impl<T: PartialEq> GiKnob<T> {
    fn set(&self, world: &mut World, camera: Entity, value: T) {
        if let Some(mut gi) = world.get_mut::<FrugalGi>(camera)
            && (self.read)(&gi) != value
        {
            (self.write)(&mut gi, value);
        }
    }
}

/// Virtual point lights (VPLs) per image; 0 turns GI off. Higher levels reduce noise; every
/// gathered pixel evaluates its interleaved share of them.
pub(crate) fn vpl_count() -> GiKnob<u32> {
    GiKnob {
        knob: || {
            Knob::new("gi_vpl_count", [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0])
        },
        is_opt_in: false,
        read: |gi| gi.vpl_count,
        write: |gi, count| gi.vpl_count = count,
        value: |level| level.value as u32,
    }
}

/// Share of pixels at which indirect light is gathered. Higher levels keep finer indirect detail,
/// at proportional cost.
pub(crate) fn pixel_share() -> GiKnob<GiPixelFraction> {
    GiKnob {
        knob: || {
            let levels = GiPixelFraction::ALL
                .map(|fraction| (fraction.share(), format!("1/{}", fraction.share().recip())));
            Knob::labelled("gi_pixel_fraction", levels).needing("gi_vpl_count", 1)
        },
        is_opt_in: false,
        read: |gi| gi.pixel_fraction,
        write: |gi, fraction| gi.pixel_fraction = fraction,
        value: |level| {
            let found =
                GiPixelFraction::ALL.into_iter().find(|fraction| fraction.share() >= level.value);
            found.unwrap_or(GiPixelFraction::Full)
        },
    }
}

/// Widths of [`interleaving`].
const INTERLEAVES: [GiInterleave; 3] = [GiInterleave::Eight, GiInterleave::Four, GiInterleave::Two];

/// Side of the square of pixels that divides the VPLs among its pixels. A narrower square gives
/// more detail at edges, at a cost that grows with the inverse of its area.
///
/// There is no level without interleaving: it would limit the VPLs of the image to the maximum per
/// pixel, fewer than at the level before it, and would come no closer to the reference.
pub(crate) fn interleaving() -> GiKnob<GiInterleave> {
    GiKnob {
        knob: || {
            let levels = INTERLEAVES
                .map(|level| (f64::from(level.side()), format!("{0}x{0}", level.side())));
            Knob::labelled("gi_interleave", levels).needing("gi_vpl_count", 1)
        },
        is_opt_in: false,
        read: |gi| gi.interleave,
        write: |gi, interleave| gi.interleave = interleave,
        value: |level| {
            let found =
                INTERLEAVES.into_iter().find(|width| f64::from(width.side()) <= level.value);
            found.unwrap_or(GiInterleave::Two)
        },
    }
}

/// Visibility rays between surfaces and VPLs. Higher levels reduce noise in indirect shadows and
/// trace more rays.
pub(crate) fn rays() -> GiKnob<GiVisibility> {
    GiKnob {
        knob: || {
            let levels = GiVisibility::ALL
                .map(|level| (f64::from(level.rays()), format!("{level:?}").to_lowercase()));
            Knob::labelled("gi_visibility", levels).needing("gi_vpl_count", 1)
        },
        is_opt_in: false,
        read: |gi| gi.visibility,
        write: |gi, visibility| gi.visibility = visibility,
        value: |level| {
            let found = GiVisibility::ALL
                .into_iter()
                .find(|visibility| f64::from(visibility.rays()) >= level.value);
            found.unwrap_or(GiVisibility::Fine)
        },
    }
}

/// Number of diffuse bounces; emissive surfaces and the sky get one fewer. Higher levels brighten
/// indirectly lit areas and trace more rays. Opt-in: more bounces brighten the whole image, and
/// that difference would mask the errors of the other knobs' cheaper levels.
pub(crate) fn bounces() -> GiKnob<u32> {
    GiKnob {
        knob: || Knob::new("gi_bounces", [1.0, 2.0, 3.0]).needing("gi_visibility", 1),
        is_opt_in: true,
        read: |gi| gi.bounces,
        write: |gi, bounces| gi.bounces = bounces,
        value: |level| level.value as u32,
    }
}

/// Environment-map samples per gathered pixel, where the camera has an environment map. Higher
/// levels reduce noise in the sky's shadows, at proportional cost. 0 leaves the diffuse light to
/// Bevy, unshadowed.
pub(crate) fn environment_samples() -> GiKnob<u32> {
    GiKnob {
        // Visibility in turn needs VPLs.
        knob: || {
            Knob::new("gi_environment_samples", [0.0, 8.0, 16.0, 32.0]).needing("gi_visibility", 1)
        },
        is_opt_in: false,
        read: |gi| gi.environment_samples,
        write: |gi, samples| gi.environment_samples = samples,
        value: |level| level.value as u32,
    }
}

/// Texels along the edge of each reflective shadow map. Higher levels capture smaller lit features;
/// the cost of rasterisation grows with the square.
pub(crate) fn rsm_resolution() -> GiKnob<u32> {
    GiKnob {
        // 512 was rejected: in four scenes a single combination with it was non-dominated, and it
        // cost 1.9 to 2.8 times as much for errors within 6 % of those at 256.
        knob: || Knob::new("rsm_resolution", [64.0, 128.0, 256.0]).needing("gi_vpl_count", 1),
        is_opt_in: false,
        read: |gi| gi.rsm_resolution,
        write: |gi, resolution| gi.rsm_resolution = resolution,
        value: |level| level.value as u32,
    }
}

/// Period of reflective shadow map rendering, in frames, while the scene changes. Shorter periods
/// lag less and cost more; 1 never lags.
pub(crate) fn refresh_period() -> GiKnob<u32> {
    GiKnob {
        knob: || {
            // The value is the frequency, so that it increases with quality.
            let levels =
                [8u32, 4, 2, 1].map(|period| (1.0 / f64::from(period), period.to_string()));
            Knob::labelled("gi_refresh_period", levels).needing("gi_vpl_count", 1)
        },
        is_opt_in: false,
        read: |gi| gi.refresh_period,
        write: |gi, period| gi.refresh_period = period,
        value: |level| level.value.recip().round() as u32,
    }
}

//! Knobs of global illumination: fields of a camera's [`FrugalGi`].

use crate::gi::{FrugalGi, GiInterleave, GiPixelFraction, GiVisibility};
use crate::knobs::{FieldKnob, Knob, KnobField};

/// The first of `all` that is good enough, else the last.
fn first<T: Copy, const N: usize>(all: [T; N], is_enough: impl Fn(T) -> bool) -> T {
    all.into_iter().find(|value| is_enough(*value)).unwrap_or(all[N - 1])
}

/// Virtual point lights (VPLs) per image; 0 turns GI off. Higher levels reduce noise; every
/// gathered pixel evaluates its interleaved share of them.
pub(super) fn vpl_count() -> FieldKnob {
    FieldKnob::new(
        Knob::new("gi_vpl_count", [0.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0]),
        KnobField::new(|gi: &mut FrugalGi| &mut gi.vpl_count, |level, _| level.value as u32),
    )
}

/// Share of pixels at which indirect light is gathered. Higher levels keep finer indirect detail,
/// at proportional cost.
pub(super) fn pixel_fraction() -> FieldKnob {
    let levels = GiPixelFraction::ALL
        .map(|fraction| (fraction.share(), format!("1/{}", fraction.share().recip())));
    FieldKnob::new(
        Knob::labelled("gi_pixel_fraction", levels).needing("gi_vpl_count", 1),
        KnobField::new(
            |gi: &mut FrugalGi| &mut gi.pixel_fraction,
            |level, _| first(GiPixelFraction::ALL, |fraction| fraction.share() >= level.value),
        ),
    )
}

/// Widths of [`interleave`].
const INTERLEAVES: [GiInterleave; 3] = [GiInterleave::Eight, GiInterleave::Four, GiInterleave::Two];

/// Side of the square of pixels that divides the VPLs among its pixels. A narrower square gives
/// more detail at edges, at a cost that grows with the inverse of its area.
///
/// There is no level without interleaving: it would limit the VPLs of the image to the maximum per
/// pixel, fewer than at the level before it, and would come no closer to the reference.
pub(super) fn interleave() -> FieldKnob {
    let levels =
        INTERLEAVES.map(|width| (f64::from(width.side()), format!("{0}x{0}", width.side())));
    FieldKnob::new(
        Knob::labelled("gi_interleave", levels).needing("gi_vpl_count", 1),
        KnobField::new(
            |gi: &mut FrugalGi| &mut gi.interleave,
            |level, _| first(INTERLEAVES, |width| f64::from(width.side()) <= level.value),
        ),
    )
}

/// Visibility rays between surfaces and VPLs. Higher levels reduce noise in indirect shadows and
/// trace more rays. At `cached` pixels share rays in space and time.
pub(super) fn visibility() -> FieldKnob {
    let levels =
        GiVisibility::ALL.map(|level| (rays_of(level), format!("{level:?}").to_lowercase()));
    FieldKnob::new(
        Knob::labelled("gi_visibility", levels).needing("gi_vpl_count", 1),
        KnobField::new(
            |gi: &mut FrugalGi| &mut gi.visibility,
            |level, _| first(GiVisibility::ALL, |visibility| rays_of(visibility) >= level.value),
        ),
    )
}

/// Rays of a low-resolution pixel; shared ones count for one.
fn rays_of(level: GiVisibility) -> f64 {
    match level {
        GiVisibility::Cached => 1.0,
        level => f64::from(level.rays()),
    }
}

/// Environment-map samples per gathered pixel, where the camera has an environment map. Higher
/// levels reduce noise in the sky's shadows, at proportional cost. 0 leaves the diffuse light to
/// Bevy, unshadowed.
pub(super) fn environment_samples() -> FieldKnob {
    FieldKnob::new(
        // Visibility in turn needs VPLs.
        Knob::new("gi_environment_samples", [0.0, 8.0, 16.0, 32.0]).needing("gi_visibility", 1),
        KnobField::new(
            |gi: &mut FrugalGi| &mut gi.environment_samples,
            |level, _| level.value as u32,
        ),
    )
}

/// Number of diffuse bounces, 9 for all; emissive surfaces and the sky get one fewer. Higher levels brighten
/// indirectly lit areas and trace more rays. Opt-in: more bounces brighten the whole image, and
/// that difference would mask the errors of the other knobs' cheaper levels.
pub(super) fn bounces() -> FieldKnob {
    let counts = [1, 2, 3].map(|count: u32| (f64::from(count), count.to_string()));
    let all = (f64::from(FrugalGi::ALL_BOUNCES), "all".to_owned());
    FieldKnob::new(
        Knob::labelled("gi_bounces", counts.into_iter().chain([all])).needing("gi_visibility", 1),
        KnobField::new(|gi: &mut FrugalGi| &mut gi.bounces, |level, _| level.value as u32),
    )
    .opt_in()
}

/// Texels along the edge of each reflective shadow map. Higher levels capture smaller lit features;
/// the cost of rasterisation grows with the square.
pub(super) fn rsm_resolution() -> FieldKnob {
    FieldKnob::new(
        Knob::new("rsm_resolution", [64.0, 128.0, 256.0]).needing("gi_vpl_count", 1),
        KnobField::new(|gi: &mut FrugalGi| &mut gi.rsm_resolution, |level, _| level.value as u32),
    )
}

/// Period of reflective shadow map rendering, in frames, while the scene changes. Shorter periods
/// lag less and cost more; 1 never lags.
pub(super) fn refresh_period() -> FieldKnob {
    // The value is the frequency, so that it increases with quality.
    let levels = [8u32, 4, 2, 1].map(|period| (1.0 / f64::from(period), period.to_string()));
    FieldKnob::new(
        Knob::labelled("gi_refresh_period", levels).needing("gi_vpl_count", 1),
        KnobField::new(
            |gi: &mut FrugalGi| &mut gi.refresh_period,
            |level, _| level.value.recip().round() as u32,
        ),
    )
}

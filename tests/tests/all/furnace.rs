//! The inside of a closed sphere with a point light at its centre: its light is known in closed
//! form.
//!
//! With intensity I candela, radius R and albedo ρ, the wall's direct radiance is ρ/π · I/R², and
//! the first bounce adds ρ times that, uniformly.

use bevy::math::Vec3;
use frugal::stage::{Component, Radiance};
use frugal_tests::{meshes, set};

tests!(
    direct_light_is_the_closed_form,
    one_bounce_is_the_closed_form,
    the_bounce_does_not_depend_on_settings
);

const LUMENS: f64 = 20_000.0;
const RADIUS: f64 = 2.0;
pub(crate) const ALBEDO: f64 = 0.8;

/// Relative to the closed form. The G-buffer's eight bits cause 0.4 %, the sphere's facets 0.3 % of
/// R², half floats 0.05 %.
pub(crate) const TOLERANCE: f64 = 0.02;

pub(crate) fn direct_radiance() -> f64 {
    let candela = LUMENS / (4.0 * std::f64::consts::PI);
    ALBEDO / std::f64::consts::PI * candela / (RADIUS * RADIUS)
}

/// Largest and mean relative deviation of any pixel and channel.
pub(crate) fn deviation(radiance: &Radiance, expected: f64) -> (f64, f64) {
    let off: Vec<f64> = radiance
        .rgb
        .iter()
        .flatten()
        .map(|value| (f64::from(*value) / expected - 1.0).abs())
        .collect();
    assert!(off.iter().all(|value| value.is_finite()), "a pixel is not finite");
    (off.iter().copied().fold(0.0, f64::max), off.iter().sum::<f64>() / off.len() as f64)
}

fn check(component: Component, expected: f64) {
    let mut stage = set::open(&set::scene("furnace"), set::radiance_options(96, 54, component));
    set::apply(&mut stage, "max,rsm_resolution=128,gi_vpl_count=256,shadow_map_resolution=512");
    for (eye, target) in [
        (Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0)),
        (Vec3::new(-0.8, 0.6, 0.1), Vec3::new(-2.0, 1.0, 0.5)),
    ] {
        set::look(&mut stage, eye, target);
        let (most, mean) = deviation(&set::radiance(&mut stage), expected);
        println!(
            "    {component:?} from {eye}: {expected:.3} nits, off by at most {:.2} %, {:.2} % in the mean",
            most * 100.0,
            mean * 100.0
        );
        assert!(most <= TOLERANCE, "{most}");
    }
}

fn direct_light_is_the_closed_form() {
    check(Component::Direct, direct_radiance());
}

fn one_bounce_is_the_closed_form() {
    check(Component::Indirect, ALBEDO * direct_radiance());
}

fn the_bounce_does_not_depend_on_settings() {
    let mut stage =
        set::open(&set::scene("furnace"), set::radiance_options(48, 27, Component::Indirect));
    set::look(&mut stage, Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    let expected = ALBEDO * direct_radiance() * (meshes::stored_albedo(ALBEDO) / ALBEDO).powi(2);
    // VPLs are sampled by their importance for the camera and carry different fluxes, so that the
    // sum of few VPLs is less exact.
    for (count, more) in [
        (64, ""),
        (1024, "gi_pixel_fraction=1/2"),
        (128, "gi_interleave=4x4,gi_visibility=coarse"),
        (64, "rsm_resolution=256"),
        (4096, "gi_interleave=2x2"),
    ] {
        let settings = format!("min,gi_vpl_count={count},{more}");
        set::apply(&mut stage, settings.trim_end_matches(','));
        let (most, mean) = deviation(&set::radiance(&mut stage), expected);
        println!(
            "    {settings}: off by at most {:.2} %, {:.2} % in the mean",
            most * 100.0,
            mean * 100.0
        );
        // Faces of 32 instead of 64 texels per side add 0.1 %.
        assert!(
            most <= TOLERANCE + 0.4 / f64::from(count).sqrt() && mean <= TOLERANCE,
            "{settings}: {most} {mean}"
        );
    }
}

//! Flux from a light to virtual point lights: nothing is lost, and RSM texels hold the flux of
//! closed forms.

use bevy::math::{Quat, Vec3};
use bevy::transform::components::Transform;
use frugal::stage::{Component, Stage};
use frugal_tests::gpu::{self, Point};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;

use super::gi::corner;

tests!(
    sun_flux_of_a_box_is_the_closed_form,
    all_flux_of_a_point_light_reaches_a_closed_room,
    sampling_keeps_the_flux,
    bounced_light_is_proportional_to_any_brightness,
    results_stay_finite_far_from_the_origin,
);

const LUX: f32 = 10_000.0;

/// Projected area of a box in a direction, m²: the sum of area × cosine over its lit faces.
fn projected_area(size: Vec3, rotation: Quat, direction: Vec3) -> f64 {
    let face = |axis: Vec3, area: f32| {
        f64::from(area * (rotation * axis).dot(direction.normalize()).abs())
    };
    face(Vec3::X, size.y * size.z) + face(Vec3::Y, size.x * size.z) + face(Vec3::Z, size.x * size.y)
}

fn sun_flux_of_a_box_is_the_closed_form() {
    let size = Vec3::new(2.0, 1.0, 1.5);
    for (direction, rotation) in
        [(Vec3::NEG_Y, Quat::IDENTITY), (Vec3::new(-0.5, -1.0, -0.3), Quat::from_rotation_y(0.4))]
    {
        let light = Light::Directional { direction, illuminance: LUX, color: [1.0, 0.5, 0.25] };
        let mut stage = set::bare(vec![light], set::radiance_options(32, 18, Component::Indirect));
        let transform = Transform::from_xyz(0.3, 2.0, 0.1).with_rotation(rotation);
        meshes::spawn(
            &mut stage,
            bevy::prelude::Cuboid::from_size(size).into(),
            meshes::diffuse(0.8, 0.4, 0.2),
            transform,
        );
        // Black, so that the map also covers a surface that reflects nothing.
        meshes::spawn_box(
            &mut stage,
            Vec3::ZERO,
            Vec3::new(6.0, 0.1, 6.0),
            meshes::diffuse(0.0, 0.0, 0.0),
        );
        set::apply(&mut stage, "min,gi_vpl_count=64,rsm_resolution=256");
        // Finer than any level of the knob.
        set::gi_without_knobs(&mut stage).rsm_resolution = 512;
        set::radiance(&mut stage);
        let found = gpu::total_flux(&gpu::rsm_texels(&stage));
        let albedo = [0.8, 0.4, 0.2].map(meshes::stored_albedo);
        for (channel, (scale, albedo)) in [1.0, 0.5, 0.25].into_iter().zip(albedo).enumerate() {
            let expected =
                f64::from(LUX) * scale * projected_area(size, rotation, direction) * albedo;
            let off = found[channel] / expected - 1.0;
            println!(
                "    along {direction}, channel {channel}: {expected:.1} lm, off by {:+.3} %",
                off * 100.0
            );
            // Texels of about 1 cm cover the silhouette to half a texel on each side.
            assert!(off.abs() < 0.01, "{off}");
        }
    }
}

fn all_flux_of_a_point_light_reaches_a_closed_room() {
    let mut stage =
        set::open(&set::scene("furnace"), set::radiance_options(32, 18, Component::Indirect));
    set::apply(&mut stage, "min,gi_vpl_count=64,rsm_resolution=128");
    set::radiance(&mut stage);
    let [red, green, blue] = gpu::total_flux(&gpu::rsm_texels(&stage));
    let expected = 20_000.0 * meshes::stored_albedo(0.8);
    println!("    {expected:.1} lm, off by {:+.3} %", (green / expected - 1.0) * 100.0);
    // The midpoint rule over 64² texels a face.
    assert!(
        (green / expected - 1.0).abs() < 0.002 && red == green && green == blue,
        "{red} {green} {blue}"
    );
}

/// Σ over VPLs against Σ over texels.
fn relative_difference(vpls: &[Point], texels: &[Point]) -> f64 {
    let luminance = |points: &[Point]| points.iter().map(Point::luminance).sum::<f64>();
    luminance(vpls) / luminance(texels) - 1.0
}

fn sampling_keeps_the_flux() {
    let lights = vec![
        Light::Directional {
            direction: Vec3::new(-0.3, -1.0, -0.4),
            illuminance: LUX,
            color: [1.0, 0.8, 0.6],
        },
        Light::Point {
            position: Vec3::new(0.5, 1.0, -0.5),
            luminous_power: 9000.0,
            range: 30.0,
            color: [0.5, 0.7, 1.0],
        },
    ];
    let mut stage = corner(lights);
    for (count, interleave) in [(64, "2x2"), (256, "4x4"), (1024, "8x8"), (4096, "2x2")] {
        set::apply(
            &mut stage,
            &format!("min,gi_vpl_count={count},gi_interleave={interleave},rsm_resolution=128"),
        );
        set::radiance(&mut stage);
        let (vpls, texels) = (gpu::vpls(&stage), gpu::rsm_texels(&stage));
        assert_eq!((vpls.len(), texels.len()), (count, 128 * 128 + 6 * 32 * 32));
        let off = relative_difference(&vpls, &texels);
        println!("    {count} VPLs: off by {off:+.1e}");
        // VPLs are sampled by their importance for the camera, and carry between zero and four
        // times the mean flux: the sum is unbiased. Independent samples would have an error of
        // 1/√count; these are stratified.
        assert!(off.abs() < 0.5 / (count as f64).sqrt(), "{count}: {off}");
        let unit = |point: &Point| (Vec3::from_array(point.normal).length() - 1.0).abs() < 1e-3;
        assert!(vpls.iter().all(|point| unit(point) && point.flux.iter().all(|flux| *flux >= 0.0)));
    }
}

/// Green flux of all VPLs of the last frame, before exposure and half floats lose anything, lumens.
fn carried(stage: &mut Stage) -> f64 {
    set::radiance(stage);
    let vpls = gpu::vpls(stage);
    assert!(vpls.iter().all(|vpl| {
        vpl.position.iter().chain(&vpl.normal).chain(&vpl.flux).all(|value| value.is_finite())
    }));
    gpu::total_flux(&vpls)[1]
}

fn bounced_light_is_proportional_to_any_brightness() {
    let mut stage = corner(vec![Light::Directional {
        direction: Vec3::NEG_Y,
        illuminance: 1.0,
        color: [1.0; 3],
    }]);
    let expected = carried(&mut stage);
    // Texels, weights and sums over them stay within 32-bit floats from about 1e-28 to 1e24 lux.
    for lux in [1e-20f32, 1e-10, 1e10, 1e20] {
        let world = stage.world_mut();
        world
            .query::<&mut bevy::light::DirectionalLight>()
            .single_mut(world)
            .expect("the sun")
            .illuminance = lux;
        let found = carried(&mut stage) / f64::from(lux);
        let image = set::radiance(&mut stage);
        println!(
            "    {lux:e} lux: {:+.1e}, mean radiance {:e} nits",
            found / expected - 1.0,
            image.mean()
        );
        assert!((found / expected - 1.0).abs() < 1e-3, "{lux}: {found} {expected}");
        assert!(image.rgb.iter().flatten().all(|value| value.is_finite()), "{lux}");
    }
}

fn results_stay_finite_far_from_the_origin() {
    for offset in [1e4f32, 1e6] {
        let mut stage = set::bare(
            vec![super::gi::sun(Vec3::NEG_Y)],
            set::radiance_options(32, 18, Component::Full),
        );
        let at = Vec3::splat(offset);
        meshes::spawn_box(&mut stage, at, Vec3::new(4.0, 0.2, 4.0), meshes::diffuse(0.8, 0.8, 0.8));
        meshes::spawn_box(
            &mut stage,
            at + Vec3::new(0.0, 1.0, -2.0),
            Vec3::new(4.0, 2.0, 0.2),
            meshes::diffuse(0.5, 0.5, 0.5),
        );
        set::look(&mut stage, at + Vec3::new(0.0, 1.2, 3.0), at + Vec3::new(0.0, 0.8, -2.0));
        set::apply(&mut stage, super::gi::PLAIN);
        let flux = carried(&mut stage);
        let image = set::radiance(&mut stage);
        assert!(
            image.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
            "at {offset}"
        );
        println!("    at {offset:e} m: {flux:.0} lm, mean {:.1} nits", image.mean());
        assert!(flux > 1000.0, "at {offset} the VPLs carry the sun's light: {flux}");
    }
}

//! `gather/gather.wgsl` against its CPU reference.

use bevy::math::{DVec3, Vec3};
use frugal_tests::gather::{Gather, geometry, irradiance};
use frugal_tests::gpu::Point;
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};

use super::{Random, Worst, cosine_slack, facing_down, stage};

tests!(
    at_distances_from_zero_to_ten_million_kilometres,
    at_fluxes_from_zero_to_beyond_half_floats,
    from_every_direction_including_grazing_and_opposite,
    a_thousand_kilometres_from_the_origin,
    nothing_is_gathered_without_a_surface_or_vpls,
);

const SIZE: [u32; 2] = [8, 8];

/// Pixels with one normal, and that normal after packing.
fn facing(stage: &frugal::stage::Stage, normal: Vec3) -> (Pixels, DVec3) {
    let (packed, normal) = g_buffer_normal(normal);
    (Pixels::new(stage, SIZE, &[packed; 64]), normal)
}

fn at_distances_from_zero_to_ten_million_kilometres() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (pixels, normal) = facing(&stage, Vec3::new(0.1, 1.0, -0.2).normalize());
    // Centre of pixel (4, 3).
    let receiver = Vec3::new(0.5, 0.0, 0.5);
    for radius_squared in [1e-10, 1e-4, 1.0, 1e6] {
        let mut worst = Worst::default();
        for distance in [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 1e3, 1e6, 1e10] {
            let vpl = facing_down(receiver + Vec3::Y * distance, 1e5, radius_squared);
            let nearest = irradiance(&[vpl], receiver.as_dvec3(), normal, 1.0)[0];
            // Exposed so that this pixel is neither black nor clipped.
            let exposure = if nearest > 0.0 { (3.0 / nearest) as f32 } else { 1.0 };
            let plane = Plane { exposure, ..Plane::ORIGIN };
            let found = gather.run(&stage, &pixels, &plane, &[vpl]);
            for (pixel, found) in (0..).zip(&found) {
                let position = plane.position(SIZE, pixel % 8, pixel / 8);
                let expected = irradiance(&[vpl], position, normal, exposure)[0];
                let slack = cosine_slack(&vpl, position, normal, vpl.flux[0], exposure);
                worst.check(
                    &format!("{distance} m, {radius_squared} m², pixel {pixel}"),
                    found[0],
                    expected,
                    slack,
                );
            }
            assert!(
                distance > 0.0 || found[3 * 8 + 4][0] == 0.0,
                "a VPL does not light its own position"
            );
        }
        worst.report(&format!("disks of {radius_squared:e} m²"), 100);
    }
}

fn at_fluxes_from_zero_to_beyond_half_floats() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (pixels, normal) = facing(&stage, Vec3::Y);
    let mut worst = Worst::default();
    let mut white = 0;
    for flux in [1e-20, 1e-10, 1.0, 1e10, 1e20, 1e25f32] {
        // Dim, of the displayed brightness, and far beyond the range of half floats.
        for exposure in [1e-3 / flux, 1.0 / flux, 0.01, 1e6 / flux] {
            let plane = Plane { exposure, ..Plane::ORIGIN };
            let vpls = [
                facing_down(Vec3::new(0.5, 1.0, 0.5), flux, 1e-4),
                facing_down(Vec3::new(-2.5, 0.25, 1.0), flux, 0.1),
            ];
            for (pixel, found) in (0..).zip(gather.run(&stage, &pixels, &plane, &vpls)) {
                let expected =
                    irradiance(&vpls, plane.position(SIZE, pixel % 8, pixel / 8), normal, exposure)
                        [1];
                worst.check(
                    &format!("{flux} lm, exposure {exposure}, pixel {pixel}"),
                    found[1],
                    expected,
                    0.0,
                );
                white += usize::from(expected > 65_504.0);
            }
        }
    }
    worst.report("flux from 1e-20 to 1e25 lm", 500);
    println!("    {white} of them beyond half floats, and clamped");
    assert!(white > 100, "{white}");
    // A thousand of the brightest and smallest VPLs, at the distance of the largest irradiance.
    let vpls = vec![facing_down(Vec3::new(0.5, 1e-5, 0.5), 1e25, 1e-10); 1024];
    for found in gather.run(&stage, &pixels, &Plane::ORIGIN, &vpls) {
        assert!(found.iter().all(|value| value.is_finite() && *value >= 0.0), "{found:?}");
    }
}

fn from_every_direction_including_grazing_and_opposite() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let mut random = Random(7);
    let to_light = Vec3::new(0.6, 0.64, 0.48);
    let across = to_light.any_orthonormal_vector();
    // Towards the light, away from it, grazing, and about 0.1° off each; then random directions.
    let tilt = 1.5e-3f32;
    let mut normals = vec![
        to_light,
        -to_light,
        across,
        -across,
        (across + tilt * to_light).normalize(),
        (across - tilt * to_light).normalize(),
        (to_light + tilt * across).normalize(),
    ];
    normals.resize_with(64, || random.direction());
    let (packed, normals): (Vec<_>, Vec<_>) = normals.into_iter().map(g_buffer_normal).unzip();
    let pixels = Pixels::new(&stage, SIZE, &packed);
    let plane = Plane { spacing: 1e-3, ..Plane::ORIGIN };
    let mut worst = Worst::default();
    // The same normals for the VPL, and one of length zero.
    let mut facings = vec![
        -to_light,
        to_light,
        across,
        (across - tilt * to_light).normalize(),
        (tilt * across - to_light).normalize(),
        Vec3::ZERO,
    ];
    facings.resize_with(24, || random.direction());
    for facing in facings {
        let vpl = Point {
            position: (to_light * 2.0).to_array(),
            normal: facing.to_array(),
            flux: [3000.0, 1.0, 20.0],
            extent: 100.0,
        };
        let found = gather.run(&stage, &pixels, &plane, &[vpl]);
        for (pixel, found) in (0..).zip(&found) {
            let position = plane.position(SIZE, pixel % 8, pixel / 8);
            let expected = irradiance(&[vpl], position, normals[pixel as usize], plane.exposure);
            for channel in 0..3 {
                let slack = cosine_slack(
                    &vpl,
                    position,
                    normals[pixel as usize],
                    vpl.flux[channel],
                    plane.exposure,
                );
                worst.check(
                    &format!("facing {facing}, pixel {pixel}"),
                    found[channel],
                    expected[channel],
                    slack,
                );
            }
        }
    }
    worst.report("normals", 500);
}

fn a_thousand_kilometres_from_the_origin() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (pixels, normal) = facing(&stage, Vec3::Y);
    for distance in [1e4f32, 1e6] {
        let mut worst = Worst::default();
        for corner in
            [Vec3::new(1.0, 1.0, 1.0), Vec3::new(-1.0, 0.0, 1.0), Vec3::new(0.0, -1.0, 0.0)]
        {
            // The spacing of floats is 6 cm there: both positions are representable.
            let plane = Plane { center: corner * distance, ..Plane::ORIGIN };
            let vpls =
                [Vec3::new(0.5, 1.0, 0.5), Vec3::new(3.0, 0.5, -2.25), Vec3::new(-1.5, 0.125, 2.5)]
                    .map(|offset| facing_down(plane.center + offset, 1000.0, 0.05));
            for (pixel, found) in (0..).zip(gather.run(&stage, &pixels, &plane, &vpls)) {
                let expected = irradiance(
                    &vpls,
                    plane.position(SIZE, pixel % 8, pixel / 8),
                    normal,
                    plane.exposure,
                )[0];
                worst.check(
                    &format!("{corner} × {distance}, pixel {pixel}"),
                    found[0],
                    expected,
                    0.0,
                );
            }
        }
        worst.report(&format!("{distance:e} m from the origin"), 100);
    }
}

fn nothing_is_gathered_without_a_surface_or_vpls() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let vpl = facing_down(Vec3::new(0.5, 1.0, 0.5), 1e5, 1e-4);
    assert!(geometry(&vpl, DVec3::new(0.5, 0.0, 0.5), normal) > 0.5);
    let sky = Pixels::with_depth(&stage, SIZE, &[packed; 64], 0.0);
    assert!(
        gather.run(&stage, &sky, &Plane::ORIGIN, &[vpl]).iter().all(|texel| *texel == [0.0; 4])
    );
    // The padding of a set is recognised by its zero flux only.
    let nothing = Point { position: [0.0; 3], normal: [0.0; 3], flux: [0.0; 3], extent: 1e10 };
    let ground = Pixels::new(&stage, SIZE, &[packed; 64]);
    for vpls in [&[][..], &[nothing], &[nothing; 7]] {
        assert!(
            gather
                .run(&stage, &ground, &Plane::ORIGIN, vpls)
                .iter()
                .all(|texel| texel[..3] == [0.0; 3]),
            "{} VPLs",
            vpls.len()
        );
    }
}

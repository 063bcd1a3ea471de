//! Energy conservation: indirect light never exceeds the available light.

use bevy::camera::Projection;
use bevy::math::{Quat, Vec3};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiInterleave;
use frugal::stage::Component;
use frugal_tests::gather::{Gather, irradiance};
use frugal_tests::gpu::{self, Point};
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;

use super::stage;

tests!(
    no_point_receives_more_than_from_an_infinite_plane,
    walls_around_a_vpl_receive_no_more_than_its_flux,
    a_closed_room_reflects_no_more_than_its_albedo
);

/// Rotations that map each side of a cube to the floor.
fn sides() -> [Quat; 6] {
    [Vec3::NEG_Y, Vec3::Y, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z]
        .map(|side| Quat::from_rotation_arc(side, Vec3::NEG_Y))
}

fn turned(vpl: &Point, rotation: Quat) -> Point {
    let [position, normal] =
        [vpl.position, vpl.normal].map(|vector| (rotation * Vec3::from_array(vector)).to_array());
    Point { position, normal, ..*vpl }
}

/// A disk of radius r emits flux ÷ πr² per square metre: an infinite plane of that exitance would
/// cause the same irradiance.
fn no_point_receives_more_than_from_an_infinite_plane() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, _) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(&stage, [8, 8], &[packed; 64]);
    let mut nearest = 0.0f64;
    for radius_squared in [1e-10, 1e-6, 1e-2, 1.0] {
        // Exposed so that the irradiance from the plane is 1000 ÷ π for any radius.
        let plane = Plane { exposure: radius_squared, ..Plane::ORIGIN };
        for height in [1e-9, 1e-6, 1e-5, 1e-3, 0.05, 0.1, 0.5, 1.0, 10.0] {
            let vpl = super::facing_down(Vec3::new(0.5, height, 0.5), 1000.0, radius_squared);
            let bound = 1000.0 / std::f64::consts::PI;
            for found in gather.run(&stage, &pixels, &plane, &[vpl]) {
                assert!(
                    found[0] <= bound * 1.001,
                    "{height} m, {radius_squared} m²: {} of {bound}",
                    found[0]
                );
                nearest = nearest.max(found[0] / bound);
            }
        }
    }
    println!("    at most {nearest:.4} of the irradiance from a plane");
    assert!(nearest > 0.99, "from very near, the disk is a plane: {nearest}");
}

/// All light of a VPL in a closed cube reaches its sides.
fn walls_around_a_vpl_receive_no_more_than_its_flux() {
    const EDGE: u32 = 32;
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, _) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(&stage, [EDGE; 2], &[packed; (EDGE * EDGE) as usize]);
    // The inside of a cube of 2 m; each side in turn is rotated to the floor.
    let spacing = 2.0 / EDGE as f32;
    let plane = Plane { center: Vec3::NEG_Y, spacing, exposure: 1e-3, ..Plane::ORIGIN };
    let lights = [
        ("in the middle", Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8)),
        ("off the middle", Vec3::new(0.5, -0.4, 0.3), Vec3::new(0.0, 1.0, 0.0)),
        ("on the floor", Vec3::new(-0.6, -1.0, 0.5), Vec3::Y),
    ];
    for (label, position, normal) in lights {
        let mut shares = Vec::new();
        for radius_squared in [1e-10, 0.01, 0.3, 3.0f32] {
            let extent = radius_squared.recip();
            let vpl = Point {
                position: position.to_array(),
                normal: normal.to_array(),
                flux: [5000.0; 3],
                extent,
            };
            let on_side = |side| {
                gather
                    .run(&stage, &pixels, &plane, &[turned(&vpl, side)])
                    .iter()
                    .map(|texel| texel[0])
                    .sum::<f64>()
            };
            let received = sides().map(on_side).iter().sum::<f64>() * f64::from(spacing * spacing)
                / f64::from(plane.exposure);
            shares.push(received / 5000.0);
        }
        println!(
            "    {label}: {shares:.4?} of its light for disks of π times 1e-10, 0.01, 0.3 and 3 m²"
        );
        // The midpoint rule over 32 × 32 pixels a side, and half floats.
        assert!(
            shares.iter().all(|share| *share < 1.005) && (shares[0] - 1.0).abs() < 0.005,
            "{label}: {shares:?}"
        );
        assert!(
            shares.is_sorted_by(|a, b| a >= b),
            "the larger the disk, the smaller the share: {shares:?}"
        );
    }
}

/// A light in a cube of 2 m with the eye in the middle: the indirect light that all walls reflect,
/// relative to the light that they receive. Each pixel of six images also agrees with the CPU
/// reference of gather and composite.
fn a_closed_room_reflects_no_more_than_its_albedo() {
    const EDGE: u32 = 32;
    for (albedo, sides) in [(1.0f32, &sides()[..]), (0.0, &sides()[..1])] {
        let light = Light::Point {
            position: Vec3::new(0.3, -0.2, 0.1),
            luminous_power: 1000.0,
            range: 30.0,
            color: [1.0; 3],
        };
        let mut stage =
            set::bare(vec![light], set::radiance_options(EDGE, EDGE, Component::Indirect));
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            // Flush at the edges, without visible overlap.
            let size = Vec3::splat(2.4) - 2.2 * axis.abs();
            meshes::spawn_box(
                &mut stage,
                axis * 1.1,
                size,
                meshes::diffuse(albedo, albedo, albedo),
            );
        }
        set::apply(
            &mut stage,
            "min,gi_refresh_period=1,gi_vpl_count=512,gi_pixel_fraction=1/1,resolution_scale=100%,rsm_resolution=128",
        );
        // The first frame applies the knobs' levels, which would overwrite the following changes.
        stage.frame();
        set::gi_without_knobs(&mut stage).interleave = GiInterleave::One;
        let camera = set::camera(&mut stage);
        let mut entity = stage.world_mut().entity_mut(camera);
        let Projection::Perspective(lens) = &mut *entity.get_mut::<Projection>().expect("a lens")
        else {
            panic!("no perspective")
        };
        lens.fov = std::f32::consts::FRAC_PI_2;
        let stored = meshes::stored_albedo(f64::from(albedo));
        let pixel_area = (2.0 / f64::from(EDGE)).powi(2);
        let (mut reflected, mut received, mut worst) = (0.0, 0.0, 0.0f64);
        for side in sides {
            // The eye looks at the side along its −z axis.
            let to_side = side.inverse() * Vec3::NEG_Y;
            let pose = Transform::default().looking_to(to_side, to_side.any_orthonormal_vector());
            stage.place(Vec3::ZERO, pose.rotation);
            let radiance = set::radiance(&mut stage);
            let vpls = gpu::vpls(&stage);
            let (_, normal) = g_buffer_normal(-to_side);
            for (pixel, found) in (0..).zip(&radiance.rgb) {
                let at = |n: u32| (n as f32 + 0.5) / EDGE as f32 * 2.0 - 1.0;
                let position = pose.rotation * Vec3::new(at(pixel % EDGE), -at(pixel / EDGE), -1.0);
                let expected = stored / std::f64::consts::PI
                    * irradiance(&vpls, position.as_dvec3(), normal, 1.0)[1];
                let found = f64::from(found[1]);
                assert!(found.is_finite() && found >= 0.0, "{found}");
                // Two roundings to half floats, and positions from a depth buffer.
                if expected > 0.1 {
                    worst = worst.max((found / expected - 1.0).abs());
                }
                reflected += found * std::f64::consts::PI * pixel_area;
            }
            received = gpu::total_flux(&gpu::rsm_texels(&stage))[1];
        }
        let share = if received > 0.0 { reflected / received } else { 0.0 };
        println!(
            "    albedo {albedo}: {received:.1} lm reflected once, {reflected:.1} lm twice: {share:.4}; off the CPU reference by {worst:.1e}"
        );
        assert!(
            (received - 1000.0 * stored).abs() < 2.0,
            "all of the light's flux reaches a wall: {received}"
        );
        assert!(worst < 2e-3, "{worst}");
        // 512 VPLs estimate the light to a few per cent, and lose light at points nearer than the
        // radius of their disks.
        assert!(share <= stored * 1.02 && share >= stored * 0.9, "{share} of {stored}");
    }
}

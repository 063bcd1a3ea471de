//! Zero, one and the maximum number of virtual point lights per pixel and per image, and of pixels.

use bevy::math::Vec3;
use bevy_frugal_gi::gi::{FrugalGi, GiInterleave};
use frugal_tests::gather::{Gather, irradiance};
use frugal_tests::gpu;
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::set;

use super::{Random, Worst, facing_down, stage};
use crate::gi::{corner, sun};

tests!(
    a_pixel_sums_any_number_of_vpls,
    images_of_any_size_are_gathered_completely,
    a_camera_takes_any_number_of_vpls
);

fn a_pixel_sums_any_number_of_vpls() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(&stage, [8, 8], &[packed; 64]);
    let mut random = Random(3);
    for count in [0, 1, 2, 15, 16, 17, 1023, FrugalGi::MAX_VPLS_PER_PIXEL] {
        let mut vpl = || {
            facing_down(
                random.inside(Vec3::new(-5.0, 0.1, -5.0), Vec3::new(5.0, 4.0, 5.0)),
                1000.0 * 3.0,
                1e-3,
            )
        };
        let vpls: Vec<_> = (0..count).map(|_| vpl()).collect();
        let plane = Plane { exposure: 0.01 / count.max(1) as f32, ..Plane::ORIGIN };
        let mut worst = Worst::default();
        for (pixel, found) in (0..).zip(gather.run(&stage, &pixels, &plane, &vpls)) {
            let expected = irradiance(
                &vpls,
                plane.position([8, 8], pixel % 8, pixel / 8),
                normal,
                plane.exposure,
            )[2];
            worst.check(&format!("{count} VPLs, pixel {pixel}"), found[2], expected, 0.0);
        }
        worst.report(&format!("{count} VPLs"), if count > 0 { 40 } else { 0 });
    }
}

fn images_of_any_size_are_gathered_completely() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage, 0);
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let vpls = [
        facing_down(Vec3::new(0.3, 2.0, 0.2), 1e5, 1e-3),
        facing_down(Vec3::new(-7.0, 3.0, 2.0), 1e6, 1e-3),
    ];
    let mut worst = Worst::default();
    for size in [[1, 1], [1, 9], [9, 1], [7, 5], [8, 8], [33, 17]] {
        let pixels = Pixels::new(&stage, size, &vec![packed; (size[0] * size[1]) as usize]);
        let found = gather.run(&stage, &pixels, &Plane::ORIGIN, &vpls);
        assert_eq!(found.len() as u32, size[0] * size[1]);
        for (pixel, found) in (0..).zip(found) {
            let position = Plane::ORIGIN.position(size, pixel % size[0], pixel / size[0]);
            let expected = irradiance(&vpls, position, normal, Plane::ORIGIN.exposure)[0];
            worst.check(&format!("{size:?}, pixel {pixel}"), found[0], expected, 0.0);
        }
    }
    worst.report("sizes", 600);
}

/// The whole pipeline from the light to the image, with the number of VPLs that the camera asks
/// for.
fn a_camera_takes_any_number_of_vpls() {
    let mut stage = corner(vec![sun(Vec3::new(0.2, -1.0, -0.1))]);
    // The first frame applies the knobs' levels, which would overwrite the following changes.
    stage.frame();
    let mut gather = |vpl_count: u32, interleave| {
        let mut gi = set::gi_without_knobs(&mut stage);
        (gi.vpl_count, gi.interleave) = (vpl_count, interleave);
        let radiance = set::radiance(&mut stage);
        assert!(
            radiance.rgb.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
            "{vpl_count} VPLs"
        );
        (radiance.mean(), gpu::vpls(&stage))
    };
    assert_eq!(gather(0, GiInterleave::One), (0.0, vec![]));
    let (one, vpls) = gather(1, GiInterleave::One);
    assert!(vpls.len() == 1 && vpls[0].flux[0] > 0.0 && one > 0.0, "{one} {vpls:?}");
    // The maximum per pixel, the maximum per image, and more, which is clamped.
    let (most_of_pixel, vpls) = gather(FrugalGi::MAX_VPLS_PER_PIXEL, GiInterleave::One);
    assert_eq!(vpls.len() as u32, FrugalGi::MAX_VPLS_PER_PIXEL);
    let (most, vpls) = gather(FrugalGi::MAX_VPL_COUNT, GiInterleave::Four);
    assert_eq!(vpls.len() as u32, FrugalGi::MAX_VPL_COUNT);
    let (more, vpls) = gather(u32::MAX, GiInterleave::Four);
    assert_eq!(vpls.len() as u32, FrugalGi::MAX_VPL_COUNT);
    println!("    1 VPL {one:.2} nits, 1,024 {most_of_pixel:.3}, 16,384 {most:.3}");
    assert_eq!(more, most);
    // About 1 % of noise; and VPL disks 16 times as large lose more light in the corner.
    assert!((most_of_pixel / most - 1.0).abs() < 0.03, "{most_of_pixel} {most}");
}

//! Cameras that fill a part of their target: split screen, and a viewport beside an interface.

use bevy::math::{UVec2, Vec3};
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;
use frugal_trace::metrics::Radiance;

use super::gi::PLAIN;

tests!(
    two_cameras_side_by_side_equal_the_same_cameras_alone,
    a_viewport_of_half_the_target_equals_the_camera_alone,
    a_viewport_shows_indirect_light_alone,
);

/// Size of a viewport, pixels.
const PART: UVec2 = UVec2::new(48, 36);
/// Position and target of each player's camera.
const LEFT: [Vec3; 2] = [Vec3::new(0.0, 1.2, 3.0), Vec3::new(0.0, 0.8, -2.0)];
const RIGHT: [Vec3; 2] = [Vec3::new(1.4, 0.5, 1.6), Vec3::new(-0.6, 1.0, -2.0)];

/// Settings that use every pass which reads the G-buffer: with and without rays and upsampling.
fn settings() -> [String; 2] {
    [PLAIN.into(), format!("{PLAIN},gi_interleave=4x4,gi_pixel_fraction=1/4,gi_visibility=coarse")]
}

/// A corner with a red box, lit by a slanting sun.
fn scene(size: UVec2, component: Component, settings: &str) -> Stage {
    let sun = Light::Directional {
        direction: Vec3::new(0.4, -1.0, -0.3),
        illuminance: 10_000.0,
        color: [1.0; 3],
    };
    let mut stage = set::bare(vec![sun], set::radiance_options(size.x, size.y, component));
    meshes::spawn_corner(&mut stage, 0.5);
    let red = meshes::diffuse(0.8, 0.1, 0.1);
    meshes::spawn_box(&mut stage, Vec3::new(0.8, 0.4, -0.6), Vec3::splat(0.8), red);
    set::apply(&mut stage, settings);
    stage
}

/// The radiance of a camera that fills a target of a viewport's size.
fn alone(component: Component, settings: &str, [position, target]: [Vec3; 2]) -> Radiance {
    let mut stage = scene(PART, component, settings);
    set::look(&mut stage, position, target);
    set::radiance(&mut stage)
}

/// The radiance of both players' cameras, each in its half of a target.
fn side_by_side(component: Component, settings: &str) -> Radiance {
    let mut stage = scene(UVec2::new(2 * PART.x, PART.y), component, settings);
    let first = set::camera(&mut stage);
    set::look(&mut stage, LEFT[0], LEFT[1]);
    let second = set::add_camera(&mut stage, RIGHT[0], RIGHT[1]);
    set::set_viewport(&mut stage, first, UVec2::ZERO, PART);
    set::set_viewport(&mut stage, second, UVec2::new(PART.x, 0), PART);
    set::radiance(&mut stage)
}

/// A rectangle of an image.
fn part(image: &Radiance, corner: UVec2) -> Radiance {
    let row = |y: u32| {
        let first = ((corner.y + y) * image.width + corner.x) as usize;
        image.rgb[first..first + PART.x as usize].iter().copied()
    };
    Radiance { width: PART.x, height: PART.y, rgb: (0..PART.y).flat_map(row).collect() }
}

/// Mean absolute difference relative to the mean of `expected`.
fn error(found: &Radiance, expected: &Radiance) -> f64 {
    let pairs = found.rgb.iter().flatten().zip(expected.rgb.iter().flatten());
    let sum = pairs.map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
    sum / expected.rgb.len() as f64 / 3.0 / expected.mean()
}

/// Differences of a rounding: the viewport's transform and the image's own round apart.
const ROUNDING: f64 = 2e-3;

fn two_cameras_side_by_side_equal_the_same_cameras_alone() {
    for settings in settings() {
        let both = side_by_side(Component::Full, &settings);
        for (side, pose) in [(0, LEFT), (1, RIGHT)] {
            let expected = alone(Component::Full, &settings, pose);
            let found = part(&both, UVec2::new(side * PART.x, 0));
            let off = error(&found, &expected);
            println!("    side {side}: off by {off:.1e}");
            assert!(off < ROUNDING, "side {side} with {settings}: {off}");
        }
    }
}

fn a_viewport_of_half_the_target_equals_the_camera_alone() {
    let [_, settings] = settings();
    let expected = alone(Component::Full, &settings, LEFT);
    let dark = alone(Component::Full, "min,gi_vpl_count=0,resolution_scale=100%", LEFT);
    let without = error(&dark, &expected);
    assert!(without > 0.05, "indirect light is a part of the image: {without}");
    let mut stage = scene(UVec2::new(2 * PART.x, PART.y + 8), Component::Full, &settings);
    let camera = set::camera(&mut stage);
    set::look(&mut stage, LEFT[0], LEFT[1]);
    for corner in [UVec2::ZERO, UVec2::new(PART.x, 0), UVec2::new(13, 5)] {
        set::set_viewport(&mut stage, camera, corner, PART);
        let off = error(&part(&set::radiance(&mut stage), corner), &expected);
        assert!(off < ROUNDING, "at {corner}: {off}");
    }
}

fn a_viewport_shows_indirect_light_alone() {
    let settings = &settings()[0];
    let both = side_by_side(Component::Indirect, settings);
    for (side, pose) in [(0, LEFT), (1, RIGHT)] {
        let expected = alone(Component::Indirect, settings, pose);
        let off = error(&part(&both, UVec2::new(side * PART.x, 0)), &expected);
        assert!(off < ROUNDING, "side {side}: {off}");
    }
}

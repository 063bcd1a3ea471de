//! Sunlight through a small hole in the roof of a closed hall.

use bevy::math::Vec3;
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;

tests!(a_hall_on_open_land_is_lit_through_a_small_hole);

/// Half the width of the hall, of the hole and of the land, and the hall's height, metres.
const HALL: f32 = 10.0;
const HOLE: f32 = 0.2;
const LAND: f32 = 200.0;
const HEIGHT: f32 = 5.0;

/// A closed hall but for a hole in its roof, on land of `land` metres around its middle.
fn hall(land: f32) -> Stage {
    let sun = Light::Directional {
        direction: Vec3::new(0.1, -1.0, 0.05),
        illuminance: 100_000.0,
        color: [1.0; 3],
    };
    let mut stage = set::bare(vec![sun], set::radiance_options(96, 54, Component::Indirect));
    let mut slab = |low: Vec3, high: Vec3| {
        let grey = meshes::diffuse(0.7, 0.7, 0.7);
        meshes::spawn_box(&mut stage, 0.5 * (low + high), high - low, grey);
    };
    let thick = 0.05;
    slab(Vec3::new(-land, -0.2, -land), Vec3::new(land, -0.1, land));
    slab(Vec3::new(-HALL, -0.1, -HALL), Vec3::new(HALL, 0.0, HALL));
    let sides: [((i32, i32), (i32, i32)); 4] =
        [((-1, -1), (-1, 1)), ((1, -1), (1, 1)), ((-1, -1), (1, -1)), ((-1, 1), (1, 1))];
    for (low, high) in sides {
        let corner = |(x, z): (i32, i32), side: f32, y| {
            Vec3::new(x as f32 * HALL + side * thick, y, z as f32 * HALL + side * thick)
        };
        slab(corner(low, -1.0, 0.0), corner(high, 1.0, HEIGHT));
    }
    let roof = |x: (f32, f32), z: (f32, f32)| {
        (Vec3::new(x.0, HEIGHT, z.0), Vec3::new(x.1, HEIGHT + thick, z.1))
    };
    for (low, high) in [
        roof((-HALL, HALL), (-HALL, -HOLE)),
        roof((-HALL, HALL), (HOLE, HALL)),
        roof((-HALL, -HOLE), (-HOLE, HOLE)),
        roof((HOLE, HALL), (-HOLE, HOLE)),
    ] {
        slab(low, high);
    }
    stage
}

/// Mean indirect light in the hall, nits, from eyes that are a centimetre apart.
fn means(land: f32, settings: &str) -> Vec<f64> {
    let mut stage = hall(land);
    set::apply(&mut stage, settings);
    let mut mean = |step: i32| {
        set::look(&mut stage, Vec3::new(6.0 + 0.01 * step as f32, 1.7, 6.0), Vec3::Y * 0.8);
        set::cut(&mut stage);
        set::channel_means(&set::radiance(&mut stage))[0]
    };
    (0..6).map(&mut mean).collect()
}

fn a_hall_on_open_land_is_lit_through_a_small_hole() {
    let alone = means(HALL, "max");
    let truth = alone.iter().sum::<f64>() / alone.len() as f64;
    // All but a part in ten thousand of the sun's light on the land stays outside.
    for (settings, mean_error, spread) in [("max", 0.15, 0.3), ("default", 0.3, 0.6)] {
        let found = means(LAND, settings);
        println!("{settings}: {found:?}, {truth} on the hall's own ground");
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        let off = mean / truth - 1.0;
        assert!(off.abs() < mean_error, "{settings}: {off}");
        for value in found {
            assert!((value / mean - 1.0).abs() < spread, "{settings}: {value} of {mean}");
        }
    }
}

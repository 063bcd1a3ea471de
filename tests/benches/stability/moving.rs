//! The moving scene, the methods and what they have in common: images, their differences, errors.

use bevy::ecs::query::With;
use bevy::light::DirectionalLight;
use bevy::math::Quat;
use bevy::transform::components::Transform;
use frugal::scene::SceneDescription;
use frugal::stage::{Component, Stage};
use frugal_tests::arguments::Arguments;
use frugal_tests::method::Method;
use frugal_tests::naive_rsm::{NaiveRsm, Weights};
use frugal_tests::reference::{self, Tracing, mean_absolute_difference};
use frugal_tests::set;
use frugal_trace::integrator::Pixels;
use frugal_trace::light::Light;
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::CameraPose;

/// Rotation of the sun around the vertical, degrees per frame: 3 degrees per second at 30 frames
/// per second.
pub(crate) const SUN_STEP_DEGREES: f32 = 0.1;
/// Step along the camera's path, seconds per frame: its 3 m/s become 0.6 m/s at 30 frames per
/// second, 2 cm per frame.
pub(crate) const PATH_STEP_SECONDS: f32 = 0.0067;
/// Frames of the same motion before the first measured one: as many as temporal accumulation
/// averages, so that it has converged.
pub(crate) const FRAMES_BEFORE: i32 = 32;

/// Frames in which a camera at rest converges.
pub(crate) const REST_FRAMES: u32 = 80;

/// The moving object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    Light,
    Camera,
    Both,
}

impl Motion {
    /// Rotation of the sun and pose of the camera in a frame. Frames −[`FRAMES_BEFORE`] to −1
    /// precede frame 0.
    pub(crate) fn at(self, scene: &SceneDescription, frame: i32) -> (Quat, CameraPose) {
        let frame = frame + FRAMES_BEFORE;
        let frame = frame as f32;
        let turn = if self == Self::Camera { 0.0 } else { frame * SUN_STEP_DEGREES.to_radians() };
        let time = if self == Self::Light { 0.0 } else { frame * PATH_STEP_SECONDS };
        let pose =
            scene.paths["tour"].sample(time).unwrap_or_else(|| panic!("courtyard has a path"));
        (Quat::from_rotation_y(turn), pose)
    }
}

pub(crate) fn methods() -> Vec<Method> {
    let naive =
        |radius, weights| Method::naive(NaiveRsm { radius, weights, ..Default::default() }, 128);
    vec![
        naive(0.1, Weights::Exact),
        naive(0.3, Weights::Exact),
        naive(0.3, Weights::Published),
        Method::ours(256, "8x8", "none", "1/16", 64),
        Method::ours(128, "2x2", "coarse", "1/16", 64),
        Method::ours(128, "2x2", "coarse", "1/16", 64).every(4),
        Method::ours(128, "2x2", "coarse", "1/16", 64).every(8),
        Method::ours(1024, "8x8", "coarse", "1/16", 128),
        Method::ours(1024, "4x4", "coarse", "1/4", 128),
        Method::ours(4096, "8x8", "fine", "1/4", 128),
        Method::ours(4096, "4x4", "fine", "1/1", 256),
        Method::ours(4096, "2x2", "fine", "1/1", 256),
    ]
}

pub(crate) fn turned(scene: &SceneDescription, turn: Quat) -> SceneDescription {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        if let Light::Directional { direction, .. } = light {
            *direction = turn * *direction;
        }
    }
    scene
}

/// A frame of the path-traced reference.
pub(crate) fn traced(
    scene: &SceneDescription,
    motion: Motion,
    frame: i32,
    seed: u64,
    options: &Arguments,
) -> Radiance {
    let (turn, pose) = motion.at(scene, frame);
    let tracing =
        Tracing { size: options.size, samples: options.samples, seed, pixels: Pixels::Middle };
    reference::one_bounce_untextured(&turned(scene, turn), pose, tracing)
}

pub(crate) fn differences(frames: &[Radiance]) -> Vec<Vec<[f32; 3]>> {
    let difference = |pair: &[Radiance]| {
        pair[0].rgb.iter().zip(&pair[1].rgb).map(|(a, b)| [0, 1, 2].map(|i| b[i] - a[i])).collect()
    };
    frames.windows(2).map(difference).collect()
}

/// Mean over steps of the mean absolute difference of two sequences' steps, over pixels for which
/// `counts` is true.
pub(crate) fn temporal_error(
    a: &[Vec<[f32; 3]>],
    b: &[Vec<[f32; 3]>],
    counts: &[Vec<bool>],
) -> f64 {
    let step = |((a, b), counts): ((&Vec<[f32; 3]>, &Vec<[f32; 3]>), &Vec<bool>)| {
        let counted = |step: &[[f32; 3]]| {
            step.iter()
                .zip(counts)
                .filter(|(_, counts)| **counts)
                .map(|(value, _)| *value)
                .collect::<Vec<_>>()
        };
        mean_absolute_difference(&counted(a), &counted(b))
    };
    a.iter().zip(b).zip(counts).map(step).sum::<f64>() / a.len() as f64
}

/// A stage without textures, and the initial rotation of its sun.
pub(crate) fn open(scene: &SceneDescription, options: &Arguments) -> (Stage, Quat) {
    let size = options.size;
    let mut stage = set::open(scene, set::radiance_options(size.x, size.y, Component::Indirect));
    reference::strip_textures(&mut stage);
    let initial = sun(&mut stage);
    (stage, initial)
}

/// Means of two images, or of two differences, pixel by pixel.
pub(crate) fn means(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<[f32; 3]> {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))).collect()
}

/// Initial rotation of the sun.
pub(crate) fn sun(stage: &mut Stage) -> Quat {
    let world = stage.world_mut();
    let sun = world.query_filtered::<&Transform, With<DirectionalLight>>().single(world);
    sun.unwrap_or_else(|error| panic!("courtyard's sun: {error}")).rotation
}

pub(crate) fn move_to(stage: &mut Stage, (turn, pose): (Quat, CameraPose), initial: Quat) {
    stage.place(pose.position, pose.rotation);
    let world = stage.world_mut();
    let mut suns = world.query_filtered::<&mut Transform, With<DirectionalLight>>();
    for mut sun in suns.iter_mut(world) {
        sun.rotation = turn * initial;
    }
}

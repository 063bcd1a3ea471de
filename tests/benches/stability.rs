//! Temporal stability while the light or the camera moves: the plugin against `naive-rsm`.
//!
//! `make bench BENCH=stability ARGS='…'`: `[--size WxH] [--spp N] [--count FRAMES] [light |
//! camera | both | disocclusion]…`
//!
//! `courtyard` with only its sun and without textures, after 32 frames of the same motion. Temporal
//! error: mean over successive frames, pixels and channels of |Δframe − Δreference| ÷ mean of the
//! reference. The reference is path-traced with the same random numbers in every frame, so that
//! most of its noise cancels in the differences. A second seed measures the remaining noise; the
//! reference is the mean of both. Along surfaces: the same over pixels that show the same surface
//! in both frames. At other pixels the difference is one between two surfaces, and depends on where
//! edges cross pixels. Error of the first and the last frame: relative L1 of 4x4 means; that of the
//! last includes the lag of temporal accumulation. The last row is at rest in every frame: its error
//! is in the images themselves, none of it noise or lag.
//!
//! Disocclusion: the camera goes half a metre in five frames and stays. Error of the pixels that show
//! another surface than before, relative L1 against the path-traced image, by frames after that.

use bevy::ecs::query::With;
use bevy::light::DirectionalLight;
use bevy::math::{Quat, UVec2, Vec3};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use frugal::metrics::{Difference, Radiance};
use frugal::reference::{Pixels, Seen};
use frugal::scene::{CameraPose, Light, SceneDescription};
use frugal::stage::{Component, Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::method::Method;
use frugal_tests::naive_rsm::{NaiveRsm, Weights};
use frugal_tests::reference::{self, Tracing, mean_absolute_difference};
use frugal_tests::set;
use frugal_tests::table::markdown;

/// Rotation of the sun around the vertical, degrees per frame: 3 degrees per second at 30 frames
/// per second.
const SUN_STEP_DEGREES: f32 = 0.1;
/// Step along the camera's path, seconds per frame: its 3 m/s become 0.6 m/s at 30 frames per
/// second, 2 cm per frame.
const PATH_STEP_SECONDS: f32 = 0.0067;
/// Frames of the same motion before the first measured one: as many as temporal accumulation
/// averages, so that it has converged.
const FRAMES_BEFORE: i32 = 32;

/// Frames in which a camera at rest converges.
const REST_FRAMES: u32 = 80;

fn methods() -> Vec<Method> {
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

/// The moving object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Light,
    Camera,
    Both,
}

impl Motion {
    /// Rotation of the sun and pose of the camera in a frame. Frames −[`FRAMES_BEFORE`] to −1
    /// precede frame 0.
    fn at(self, scene: &SceneDescription, frame: i32) -> (Quat, CameraPose) {
        let frame = frame + FRAMES_BEFORE;
        let frame = frame as f32;
        let turn = if self == Self::Camera { 0.0 } else { frame * SUN_STEP_DEGREES.to_radians() };
        let time = if self == Self::Light { 0.0 } else { frame * PATH_STEP_SECONDS };
        let pose =
            scene.paths["tour"].sample(time).unwrap_or_else(|| panic!("courtyard has a path"));
        (Quat::from_rotation_y(turn), pose)
    }
}

fn main() {
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let options =
        Arguments { size: UVec2::new(96, 54), samples: 256, count: 8, names: vec![] }.read();
    println!(
        "Adapter: {}. `courtyard`, sun alone, no textures, {}x{}, {} steps.\n",
        adapter.name, options.size.x, options.size.y, options.count
    );
    for (motion, name, moving) in [
        (Motion::Light, "light", "The light moves"),
        (Motion::Camera, "camera", "The camera moves"),
        (Motion::Both, "both", "Both move"),
    ] {
        if options.wants(name) {
            measure(motion, moving, &options);
        }
    }
    if options.wants("disocclusion") {
        disocclude(&options);
    }
}

/// Steps of the camera's path in each of five frames, and frames after which errors are printed.
const STRIDE: i32 = 5;
const AFTER: [u32; 6] = [1, 2, 4, 8, 16, REST_FRAMES];

/// Errors of what came into view, by frames since.
fn disocclude(options: &Arguments) {
    let scene = reference::without_environment(&set::scene("courtyard"));
    let (motion, end) = (Motion::Camera, 5 * STRIDE);
    let [first, second] = [0, 1].map(|seed| traced(&scene, motion, end, seed, options));
    let reference = means(&first.rgb, &second.rgb);
    let seen = |frame: i32| {
        reference::surfaces_untextured(&scene, motion.at(&scene, frame).1, options.size)
    };
    let stays = reprojected(
        &seen(0),
        &seen(end),
        (motion.at(&scene, 0).1, scene.camera.vertical_fov),
        options.size,
    );
    let new = |rgb: &[[f32; 3]]| -> Vec<[f32; 3]> {
        rgb.iter().zip(&stays).filter(|(_, stays)| !**stays).map(|(rgb, _)| *rgb).collect()
    };
    let shown = new(&reference);
    let mean =
        shown.iter().flatten().map(|v| f64::from(*v)).sum::<f64>() / (3 * shown.len()) as f64;
    let (mut stage, initial) = open(&scene, options);
    let mut rows = Vec::new();
    for method in methods().into_iter().filter(|method| !method.is_naive()) {
        move_to(&mut stage, motion.at(&scene, -FRAMES_BEFORE), initial);
        method.radiance(&mut stage);
        // As in an app: the camera goes on gathering where it stays.
        stage.world_mut().insert_resource(GiRefresh::OnChange);
        set::gi(&mut stage).rest_frames = FrugalGi::default().rest_frames;
        let walk = (1 - FRAMES_BEFORE..=0).chain((1..=5).map(|step| step * STRIDE));
        for frame in walk {
            move_to(&mut stage, motion.at(&scene, frame), initial);
            stage.frame();
        }
        let mut errors = Vec::new();
        for frame in 1..=AFTER[AFTER.len() - 1] {
            // That in which the camera arrived is the first.
            if frame > 1 {
                stage.frame();
            }
            if AFTER.contains(&frame) {
                let image = stage.radiance().unwrap_or_else(|error| panic!("{error}"));
                errors.push(mean_absolute_difference(&new(&image.rgb), &shown) / mean);
            }
        }
        let settled = errors[errors.len() - 1];
        let of = |error: &f64| format!("{error:.3} ({:.2})", error / settled);
        rows.push([vec![method.name.clone()], errors.iter().map(of).collect()].concat());
    }
    println!("## Disocclusion\n\n{} of {} pixels are new.\n", shown.len(), reference.len());
    let after = AFTER.map(|frames| format!("after {frames} (relative to the last)"));
    let headers: Vec<&str> =
        std::iter::once("method").chain(after.iter().map(String::as_str)).collect();
    println!("{}\n", markdown(&headers, &rows));
}

/// For each pixel of a view, whether the pose `from` showed its surface: the point projects to a
/// pixel that `before` shows on the same surface. `before`: what that pose shows, with a vertical field
/// of view of `degrees`.
fn reprojected(
    before: &[Option<Seen>],
    now: &[Option<Seen>],
    (from, degrees): (CameraPose, f32),
    size: UVec2,
) -> Vec<bool> {
    let view = from.rotation.inverse();
    let scale = 1.0 / (0.5 * degrees.to_radians()).tan();
    let aspect = size.x as f32 / size.y as f32;
    let shows = |seen: &Option<Seen>| {
        let Some(seen) = seen else { return true };
        let at = view * (seen.position.as_vec3() - from.position);
        let (x, y) = (at.x * scale / aspect / -at.z, at.y * scale / -at.z);
        if at.z >= 0.0 || x.abs() >= 1.0 || y.abs() >= 1.0 {
            return false;
        }
        let pixel = |at: f32, count: u32| ((at * count as f32) as u32).min(count - 1);
        let (column, row) = (pixel(0.5 + 0.5 * x, size.x), pixel(0.5 - 0.5 * y, size.y));
        let Some(other) = &before[(row * size.x + column) as usize] else { return false };
        let far = f64::from(at.length());
        (seen.position - other.position).dot(other.normal).abs() < 1e-2 * far
            && (seen.position - other.position).length() < 0.1 * far
    };
    now.iter().map(shows).collect()
}

fn turned(scene: &SceneDescription, turn: Quat) -> SceneDescription {
    let mut scene = scene.clone();
    for light in &mut scene.lights {
        if let Light::Directional { direction, .. } = light {
            *direction = turn * *direction;
        }
    }
    scene
}

fn differences(frames: &[Radiance]) -> Vec<Vec<[f32; 3]>> {
    let difference = |pair: &[Radiance]| {
        pair[0].rgb.iter().zip(&pair[1].rgb).map(|(a, b)| [0, 1, 2].map(|i| b[i] - a[i])).collect()
    };
    frames.windows(2).map(difference).collect()
}

/// Mean over steps of the mean absolute difference of two sequences' steps, over pixels for which
/// `counts` is true.
fn temporal_error(a: &[Vec<[f32; 3]>], b: &[Vec<[f32; 3]>], counts: &[Vec<bool>]) -> f64 {
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

/// For each pixel, whether it shows the same surface in two frames: each point lies near the other
/// and near its tangent plane.
fn show_same_surface(before: &[Option<Seen>], after: &[Option<Seen>], eye: Vec3) -> Vec<bool> {
    let stays = |(before, after): (&Option<Seen>, &Option<Seen>)| {
        let (Some(before), Some(after)) = (before, after) else {
            return before.is_none() == after.is_none();
        };
        let (delta, far) =
            (after.position - before.position, before.position.distance(eye.as_dvec3()));
        let off_plane = delta.dot(before.normal).abs().max(delta.dot(after.normal).abs());
        before.normal.dot(after.normal) > 0.95
            && off_plane < 2e-3 * far
            && delta.length() < 0.2 * far
    };
    before.iter().zip(after).map(stays).collect()
}

/// A frame of the path-traced reference.
fn traced(
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

/// The frames from 0 to `count` by a method, after some that fill its history. `rest`: frames for
/// which everything rests before each of them.
fn rendered(
    stage: &mut Stage,
    method: &Method,
    (count, rest): (i32, u32),
    move_to: impl Fn(&mut Stage, i32),
) -> Vec<Radiance> {
    move_to(stage, -FRAMES_BEFORE);
    method.radiance(stage);
    let camera = set::camera(stage);
    if let Some(mut gi) = stage.world_mut().get_mut::<FrugalGi>(camera) {
        gi.rest_frames = rest.min(FrugalGi::MAX_REST_FRAMES);
    }
    // The stage's own policy, under which nothing rests.
    let policy = if rest > 0 { GiRefresh::OnChange } else { GiRefresh::AsIfCamerasMoved };
    stage.world_mut().insert_resource(policy);
    let mut frames = Vec::new();
    for frame in 1 - FRAMES_BEFORE..=count {
        move_to(stage, frame);
        stage.frame();
        if frame >= 0 {
            (0..rest).for_each(|_| stage.frame());
            frames.push(stage.radiance().unwrap_or_else(|error| panic!("{error}")));
        }
    }
    frames
}

fn measure(motion: Motion, moving: &str, options: &Arguments) {
    let scene = reference::without_environment(&set::scene("courtyard"));
    let count = options.count as i32;
    let started = std::time::Instant::now();
    let traced =
        |seed| (0..=count).map(|frame| traced(&scene, motion, frame, seed, options)).collect();
    let (frames, second): (Vec<Radiance>, Vec<Radiance>) = (traced(0), traced(1));
    let (start, last) = (&frames[0], &frames[frames.len() - 1]);
    let mean = start.mean();
    let (first, second) = (differences(&frames), differences(&second));
    let reference: Vec<Vec<[f32; 3]>> =
        first.iter().zip(&second).map(|(a, b)| means(a, b)).collect();
    let everywhere = vec![vec![true; reference[0].len()]; reference.len()];
    let shown: Vec<_> = (0..=count)
        .map(|frame| {
            reference::surfaces_untextured(&scene, motion.at(&scene, frame).1, options.size)
        })
        .collect();
    let eye = motion.at(&scene, 0).1.position;
    let along: Vec<_> =
        shown.windows(2).map(|pair| show_same_surface(&pair[0], &pair[1], eye)).collect();
    let still = vec![vec![[0.0; 3]; reference[0].len()]; reference.len()];
    let percent = |value: f64| format!("{:.3} %", 100.0 * value / mean);
    println!("## {moving}\n");
    println!(
        "Reference: twice {} paths per pixel, {:.0} s. Its own noise: {} of the mean, {} along surfaces; a constant image has an error of {}, {} along \
         surfaces, which are {:.1} % of the pixels.\n",
        options.samples,
        started.elapsed().as_secs_f64(),
        percent(0.5 * temporal_error(&first, &second, &everywhere)),
        percent(0.5 * temporal_error(&first, &second, &along)),
        percent(temporal_error(&still, &reference, &everywhere)),
        percent(temporal_error(&still, &reference, &along)),
        100.0 * along.iter().flatten().filter(|stays| **stays).count() as f64
            / along.iter().flatten().count() as f64
    );
    let (mut stage, initial) = open(&scene, options);
    let mut found = Vec::new();
    let moving = methods().into_iter().map(|method| (method, 0));
    // Without noise and lag: what is left is in the image itself.
    let rested = methods().pop().map(|best| {
        let name = format!("{}, at rest in every frame", best.name);
        (best.named(name), REST_FRAMES)
    });
    for (method, rest) in moving.chain(rested) {
        let frames = rendered(&mut stage, &method, (count, rest), |stage, frame| {
            move_to(stage, motion.at(&scene, frame), initial);
        });
        let error = |own: &Radiance, reference: &Radiance| {
            Difference::new(own, reference, None)
                .unwrap_or_else(|error| panic!("{error}"))
                .relative_l1_boxes
        };
        let image_errors = [error(&frames[0], start), error(&frames[frames.len() - 1], last)];
        let steps = differences(&frames);
        found.push((
            method,
            image_errors,
            [&everywhere, &along].map(|counts| temporal_error(&steps, &reference, counts)),
        ));
    }
    // A dark image hardly changes: the baseline is the variant with the smallest error of the first
    // frame, not the one with the smallest temporal error.
    let naive = found
        .iter()
        .filter(|(method, ..)| method.is_naive())
        .min_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let naive = naive.unwrap_or_else(|| panic!("there are some")).2;
    let row = |(method, image_errors, temporal): &(Method, [f64; 2], [f64; 2])| {
        let of_naive = |index: usize| {
            format!("{} ({:.2})", percent(temporal[index]), temporal[index] / naive[index])
        };
        vec![
            method.name.clone(),
            image_errors.map(|error| format!("{error:.3}")).join(", "),
            of_naive(0),
            of_naive(1),
        ]
    };
    let headers = [
        "method",
        "error of the first frame, the last",
        "temporal error (relative to the most accurate naive-rsm)",
        "along surfaces (the same)",
    ];
    println!("{}\n", markdown(&headers, &found.iter().map(row).collect::<Vec<_>>()));
}

/// A stage without textures, and the initial rotation of its sun.
fn open(scene: &SceneDescription, options: &Arguments) -> (Stage, Quat) {
    let size = options.size;
    let mut stage = set::open(scene, set::radiance_options(size.x, size.y, Component::Indirect));
    reference::strip_textures(&mut stage);
    let initial = sun(&mut stage);
    (stage, initial)
}

/// Means of two images, or of two differences, pixel by pixel.
fn means(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<[f32; 3]> {
    a.iter().zip(b).map(|(a, b)| [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))).collect()
}

/// Initial rotation of the sun.
fn sun(stage: &mut Stage) -> Quat {
    let world = stage.world_mut();
    let sun = world.query_filtered::<&Transform, With<DirectionalLight>>().single(world);
    sun.unwrap_or_else(|error| panic!("courtyard's sun: {error}")).rotation
}

fn move_to(stage: &mut Stage, (turn, pose): (Quat, CameraPose), initial: Quat) {
    stage.place(pose.position, pose.rotation);
    let world = stage.world_mut();
    let mut suns = world.query_filtered::<&mut Transform, With<DirectionalLight>>();
    for mut sun in suns.iter_mut(world) {
        sun.rotation = turn * initial;
    }
}

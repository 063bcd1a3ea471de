//! Temporal error of every method while the light, the camera or both move.

use bevy::math::Vec3;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use frugal::stage::Stage;
use frugal_tests::arguments::Arguments;
use frugal_tests::method::Method;
use frugal_tests::table::markdown;
use frugal_tests::{reference, set};
use frugal_trace::integrator::FirstHit;
use frugal_trace::metrics::{Difference, Radiance};

use crate::moving::{
    FRAMES_BEFORE, Motion, REST_FRAMES, differences, means, methods, move_to, open, temporal_error,
    traced,
};

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

/// Prints the table of one motion.
pub(crate) fn measure(motion: Motion, moving: &str, options: &Arguments) {
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

/// For each pixel, whether it shows the same surface in two frames: each point lies near the other
/// and near its tangent plane.
fn show_same_surface(
    before: &[Option<FirstHit>],
    after: &[Option<FirstHit>],
    eye: Vec3,
) -> Vec<bool> {
    let stays = |(before, after): (&Option<FirstHit>, &Option<FirstHit>)| {
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

//! Error of what comes into view, by frames since.

use bevy::math::UVec2;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use frugal_tests::arguments::Arguments;
use frugal_tests::reference::mean_absolute_difference;
use frugal_tests::table::markdown;
use frugal_tests::{reference, set};
use frugal_trace::integrator::FirstHit;
use frugal_trace::scene::CameraPose;

use crate::moving::{FRAMES_BEFORE, Motion, REST_FRAMES, means, methods, move_to, open, traced};

/// Steps of the camera's path in each of five frames, and frames after which errors are printed.
const STRIDE: i32 = 5;
const AFTER: [u32; 6] = [1, 2, 4, 8, 16, REST_FRAMES];

/// Errors of what came into view, by frames since.
pub(crate) fn disocclude(options: &Arguments) {
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
    before: &[Option<FirstHit>],
    now: &[Option<FirstHit>],
    (from, degrees): (CameraPose, f32),
    size: UVec2,
) -> Vec<bool> {
    let view = from.rotation.inverse();
    let scale = 1.0 / (0.5 * degrees.to_radians()).tan();
    let aspect = size.x as f32 / size.y as f32;
    let shows = |seen: &Option<FirstHit>| {
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

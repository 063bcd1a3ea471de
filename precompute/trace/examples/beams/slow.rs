//! The same light by its time of arrival.

use std::path::Path;

use frugal_trace::integrator::Watch;
use frugal_trace::time::{
    Beams, Frames, SPEED_OF_LIGHT, Spread, Window, beams, frames, progressive,
};

use crate::scenes::Place;
use crate::{PHOTONS, RADIUS, error, settings};

/// Ways of light, metres, and how many frames they are.
const METRES: [f64; 2] = [2.5, 7.5];
const FRAMES: u32 = 40;
/// Bandwidth of the first pass's kernel, metres.
const BANDWIDTH: f64 = 0.25;
/// Paths of a pixel in a pass of paths with kernels.
const SAMPLES: u32 = 8;

fn window() -> Window {
    let [start, end] = METRES.map(|metres| metres / SPEED_OF_LIGHT);
    Window { start, end, frames: FRAMES, at_surfaces: false }
}

fn by_beams(place: &Place, spread: Spread, passes: u32, seed: u64) -> Frames {
    let (settings, of) =
        (settings(place, passes, seed), Beams { photons: PHOTONS, radius: RADIUS });
    let (scene, view) = (&place.scene, &place.view);
    beams(scene, view, &settings, of, window(), spread, Watch::default()).expect("fog").1
}

/// With a kernel, in passes of [`SAMPLES`] whose bandwidth shrinks.
fn by_paths(place: &Place, spread: Spread, samples: u32, seed: u64) -> Frames {
    let (scene, view, watch) = (&place.scene, &place.view, Watch::default());
    let found = match spread {
        Spread::Bins => {
            let settings = settings(place, samples, seed);
            frames(scene, view, &settings, window(), spread, watch).map(|found| found.1)
        }
        Spread::Kernel(first) => {
            let (settings, passes) =
                (settings(place, SAMPLES.min(samples), seed), samples / SAMPLES);
            progressive(scene, view, &settings, window(), first, passes, watch)
        }
    };
    found.expect("a window")
}

/// Prints errors of frames, of beams and of paths, and writes the truth as an animation.
pub(crate) fn compare(place: &Place, seeds: u64, length: u32, folder: Option<&Path>) {
    let many = by_beams(place, Spread::Bins, length, 998);
    let paths = by_paths(place, Spread::Bins, length * 2, 998);
    let sum = |frames: &Frames| frames.values.iter().map(|value| f64::from(value[1])).sum::<f64>();
    let name = format!("{}, in time", place.name);
    let apart = error(&paths.values, &many.values);
    println!(
        "{name}: paths / beams of long runs {:.4}, difference {apart:.4}",
        sum(&paths) / sum(&many)
    );
    let truth = if place.is_found_by_paths { paths } else { many };
    for (kind, spread) in
        [("bins", Spread::Bins), ("kernels", Spread::Kernel(BANDWIDTH / SPEED_OF_LIGHT))]
    {
        let beams = |passes, seed| by_beams(place, spread, passes, seed).values;
        let paths = |samples, seed| by_paths(place, spread, samples, seed).values;
        crate::compare(&format!("{name}, {kind}"), [&beams, &paths], &truth.values, seeds);
    }
    let Some(folder) = folder else { return };
    let mut values: Vec<f32> = truth.values.iter().map(|rgb| rgb[1]).filter(|v| *v > 0.0).collect();
    values.sort_by(f32::total_cmp);
    let white = values.get(values.len() * 99 / 100).copied().unwrap_or(1.0);
    let file = folder.join(format!("{}.png", place.name.replace([' ', ','], "_")));
    let bytes = truth.to_animation(white, 8).expect("frames");
    std::fs::write(file, bytes).expect("a folder that can be written to");
}

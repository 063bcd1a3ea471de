//! Beams of photons in fog against paths from the camera at equal time, where light is a spot's, comes
//! through a slit, and is thrown by a mirror; in the steady image and by time of arrival.
//!
//! `cargo run --release -p frugal_trace --features media,time --example beams -- [SEEDS [LENGTH [FOLDER]]]`, on
//! Linux. Times are those of one thread's processor. Every figure is the median over the seeds, with
//! the least and the greatest. LENGTH: passes of the run that stands for the truth. Animations of the
//! light on its way go into the folder.

mod scenes;
#[path = "../common/sheet.rs"]
mod sheet;
mod slow;
#[path = "../common/timing.rs"]
mod timing;

use frugal_trace::fog_beams;
use frugal_trace::integrator::{Settings, Watch, render};
use frugal_trace::metrics::Radiance;
use scenes::Place;
use timing::timed;

/// Photons of a pass.
const PHOTONS: u32 = 2000;
/// Radius of the first pass, metres: a fortieth of the fog.
const RADIUS: f64 = 0.05;

/// Root of the mean squared error ÷ the mean.
fn error(image: &[[f32; 3]], truth: &[[f32; 3]]) -> f64 {
    let squares: f64 = image.iter().zip(truth).map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum();
    let sum: f64 = truth.iter().map(|value| f64::from(value[1])).sum();
    (squares * truth.len() as f64).sqrt() / sum
}

fn settings(place: &Place, samples: u32, seed: u64) -> Settings {
    Settings { samples, seed, bounces: place.bounces, ..Settings::default() }
}

fn beams(place: &Place, passes: u32, seed: u64) -> Radiance {
    let (settings, scene, view) = (settings(place, passes, seed), &place.scene, &place.view);
    fog_beams::render(scene, view, &settings, PHOTONS, RADIUS, Watch::default()).expect("fog")
}

fn paths(place: &Place, samples: u32, seed: u64) -> Radiance {
    let settings = settings(place, samples, seed);
    let image = render(&place.scene, &place.view, &settings, Watch::default());
    image.expect("not interrupted").full()
}

/// An image by a number of passes or samples and a seed.
type Method<'a> = &'a (dyn Fn(u32, u64) -> Vec<[f32; 3]> + Sync);

/// Seconds; error; error of paths in that time; its ratio to the beams'.
fn run([beams, paths]: [Method; 2], passes: u32, seed: u64, truth: &[[f32; 3]]) -> [f64; 4] {
    let (image, seconds) = timed(|| beams(passes, seed));
    // As many as fit that time, from the time of a few; what rounding leaves is noise's square.
    let samples = (4.0 * seconds / timed(|| paths(4, seed)).1).round().max(1.0);
    let (other, spent) = timed(|| paths(samples as u32, seed));
    let (own, other) = (error(&image, truth), error(&other, truth) * (spent / seconds).sqrt());
    [seconds, own, other, other / own]
}

/// Prints what `methods`, beams and paths, reach on one thread.
fn compare(name: &str, methods: [Method; 2], truth: &[[f32; 3]], seeds: u64) {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for passes in [4, 32] {
        let mut runs: Vec<[f64; 4]> =
            (0..seeds).map(|seed| one.install(|| run(methods, passes, seed, truth))).collect();
        print!("{name}, {passes} passes:");
        for column in 0..4 {
            runs.sort_by(|a, b| a[column].total_cmp(&b[column]));
            let at = |run: usize| runs[run][column];
            print!(" {:.4} [{:.4}, {:.4}];", at(runs.len() / 2), at(0), at(runs.len() - 1));
        }
        println!();
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: u64| {
        arguments.get(index).map_or(default, |text| text.parse().expect("a number"))
    };
    let (seeds, length) = (number(0, 5).max(1), number(1, 1000) as u32);
    println!("seconds; error; error of paths in that time; paths / beams");
    for place in scenes::all() {
        let (by_beams, by_paths) = (beams(&place, length, 999), paths(&place, length * 2, 999));
        println!(
            "{}: means of long runs {:.5} and {:.5} nits, difference {:.4}",
            place.name,
            by_beams.mean(),
            by_paths.mean(),
            error(&by_paths.rgb, &by_beams.rgb)
        );
        let truth = if place.is_found_by_paths { by_paths } else { by_beams };
        let by_beams = |passes, seed| beams(&place, passes, seed).rgb;
        let by_paths = |samples, seed| paths(&place, samples, seed).rgb;
        compare(place.name, [&by_beams, &by_paths], &truth.rgb, seeds);
        slow::compare(&place, seeds, length, arguments.get(2).map(std::path::Path::new));
    }
}

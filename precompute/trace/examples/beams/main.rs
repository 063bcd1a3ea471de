//! Beams of photons in fog against paths from the camera at equal time, where light is a spot's, comes
//! through a slit, and is thrown by a mirror.
//!
//! `cargo run --release -p frugal_trace --features media --example beams -- [SEEDS [LENGTH]]`, on Linux. Times
//! are those of one thread's processor. Every figure is the median over the seeds, with the least
//! and the greatest. LENGTH: passes of the run that stands for the truth.

mod scenes;
#[path = "../common/sheet.rs"]
mod sheet;
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
fn error(image: &Radiance, truth: &Radiance) -> f64 {
    let pairs = image.rgb.iter().zip(&truth.rgb);
    let squares: f64 = pairs.map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum();
    (squares / truth.rgb.len() as f64).sqrt() / truth.mean()
}

fn settings(place: &Place, samples: u32, seed: u64) -> Settings {
    Settings { samples, seed, bounces: place.bounces, ..Settings::default() }
}

fn beams(place: &Place, passes: u32, seed: u64) -> (Radiance, f64) {
    let (settings, scene, view) = (settings(place, passes, seed), &place.scene, &place.view);
    let (image, seconds) =
        timed(|| fog_beams::render(scene, view, &settings, PHOTONS, RADIUS, Watch::default()));
    (image.expect("fog"), seconds)
}

fn paths(place: &Place, samples: u32, seed: u64) -> (Radiance, f64) {
    let settings = settings(place, samples, seed);
    let (image, seconds) = timed(|| render(&place.scene, &place.view, &settings, Watch::default()));
    (image.expect("not interrupted").full(), seconds)
}

/// Seconds; error; error of paths in that time; its ratio to the beams'.
fn run(place: &Place, passes: u32, seed: u64, truth: &Radiance) -> [f64; 4] {
    let (image, seconds) = beams(place, passes, seed);
    // As many as fit that time, from the time of a few; what rounding leaves is noise's square.
    let samples = (4.0 * seconds / paths(place, 4, seed).1).round().max(1.0);
    let (other, spent) = paths(place, samples as u32, seed);
    let (own, other) = (error(&image, truth), error(&other, truth) * (spent / seconds).sqrt());
    [seconds, own, other, other / own]
}

fn main() {
    let number = |index, default: u64| {
        std::env::args().nth(index).map_or(default, |text| text.parse().expect("a number"))
    };
    let (seeds, length) = (number(1, 5).max(1), number(2, 1000) as u32);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    println!("seconds; error; error of paths in that time; paths / beams");
    for place in scenes::all() {
        let (by_beams, by_paths) = (beams(&place, length, 999).0, paths(&place, length * 2, 999).0);
        println!(
            "{}: means of long runs {:.5} and {:.5} nits, difference {:.4}",
            place.name,
            by_beams.mean(),
            by_paths.mean(),
            error(&by_paths, &by_beams)
        );
        let truth = if place.is_found_by_paths { by_paths } else { by_beams };
        for passes in [4, 32] {
            let mut runs: Vec<[f64; 4]> =
                (0..seeds).map(|seed| one.install(|| run(&place, passes, seed, &truth))).collect();
            print!("{}, {passes} passes:", place.name);
            for column in 0..4 {
                runs.sort_by(|a, b| a[column].total_cmp(&b[column]));
                let at = |run: usize| runs[run][column];
                print!(" {:.4} [{:.4}, {:.4}];", at(runs.len() / 2), at(0), at(runs.len() - 1));
            }
            println!();
        }
    }
}

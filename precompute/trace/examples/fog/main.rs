//! A cache of light in fog against paths at equal time, in three dark rooms with bright panels.
//!
//! `cargo run --release -p frugal_trace --features media --example fog -- [SEEDS]`, on Linux. Times
//! are those of one thread's processor. Every figure is the median over the seeds, with the least
//! and the greatest.

mod scenes;
#[path = "../common/timing.rs"]
mod timing;

use frugal_trace::fog_cache::{Cache, CacheSettings, Shape};
use frugal_trace::integrator::{Pixels, Settings, Watch, render};
use frugal_trace::metrics::Radiance;
use scenes::Place;
use timing::timed;

/// Root of the mean squared error ÷ the mean, at the pixels of an image `scale`, odd, times as wide
/// that have the same centres as the truth's.
fn error(image: &Radiance, scale: u32, truth: &[f64]) -> f64 {
    let width = image.width / scale;
    let squares = truth.iter().enumerate().map(|(index, exact)| {
        let (x, y) = (index as u32 % width, index as u32 / width);
        let place = (y * scale + scale / 2) * image.width + x * scale + scale / 2;
        (f64::from(image.rgb[place as usize][1]) - exact).powi(2)
    });
    let count = truth.len() as f64;
    (squares.sum::<f64>() / count).sqrt() / (truth.iter().sum::<f64>() / count)
}

/// Records; seconds; error; error of paths in that time; its ratio to the cache's.
fn run(place: &Place, scale: u32, shape: Shape, seed: u64, truth: &[f64]) -> [f64; 5] {
    let view = place.view(scale);
    // The default settings, scaled as the room is.
    let CacheSettings { radii, step, tolerance, .. } = CacheSettings::default();
    let settings = CacheSettings {
        radii: radii.map(|radius| radius * place.size),
        step: step * place.size,
        tolerance: tolerance * place.size.powi(3),
        shape,
        seed,
        ..Default::default()
    };
    let ((image, records), seconds) = timed(|| {
        let cache = Cache::new(&place.scene, &view, settings).expect("even fog");
        (cache.image(&place.scene, &view), cache.count())
    });
    let paths = |samples| {
        let pixels = Pixels::Middle;
        let settings = Settings { samples, bounces: Some(0), seed, pixels, ..Settings::default() };
        let render = || render(&place.scene, &view, &settings, Watch::default());
        let (image, spent) = timed(render);
        (image.expect("not interrupted").full(), spent)
    };
    // As many as fit that time, from the time of a few; what rounding leaves is noise's square.
    let samples = (2.0 * seconds / paths(2).1).round().max(1.0);
    let (other, spent) = paths(samples as u32);
    let own = error(&image, scale, truth);
    let other = error(&other, scale, truth) * (spent / seconds).sqrt();
    [records as f64, seconds, own, other, other / own]
}

fn main() {
    let seeds: u64 = std::env::args().nth(1).map_or(5, |text| text.parse().expect("a number"));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    println!("records; seconds; error; error of paths in that time; paths / cache");
    for place in scenes::all() {
        let truth = place.exact();
        for scale in [1, 5] {
            for shape in [Shape::Anisotropic, Shape::Isotropic] {
                let mut runs: Vec<[f64; 5]> = (0..seeds.max(1))
                    .map(|seed| one.install(|| run(&place, scale, shape, seed, &truth)))
                    .collect();
                let pixels = place.view(scale).size.element_product();
                print!("{}, {pixels} pixels, {shape:?}:", place.name);
                for column in 0..5 {
                    runs.sort_by(|a, b| a[column].total_cmp(&b[column]));
                    let at = |run: usize| runs[run][column];
                    print!(" {:.4} [{:.4}, {:.4}];", at(runs.len() / 2), at(0), at(runs.len() - 1));
                }
                println!();
            }
        }
    }
}

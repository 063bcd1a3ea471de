//! Error of density estimates of caustics at equal numbers of photons, on six scenes.
//!
//! `cargo run -p frugal_trace --features caustics --example caustics -- [PHOTONS [SEEDS [TIMES
//! [FOLDER]]]]`
//!
//! Root of the mean squared error of the photons' image against one of TIMES as many photons,
//! divided by the mean of that one: median over the seeds, and the least and the greatest. FOLDER
//! gets pictures.

mod scenes;
#[path = "../common/sheet.rs"]
mod sheet;

use std::path::Path;

use frugal_trace::caustics::{Caustics, Density, photon_image, render};
use frugal_trace::integrator::{Pixels, Settings, Watch, render as path_trace};
use frugal_trace::metrics::{Radiance, tone};
use glam::UVec2;

const PASSES: u32 = 10;
const SIZE: UVec2 = UVec2::new(96, 72);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u32| {
        arguments.get(i).map_or(default, |text: &String| text.parse().expect("a whole number"))
    };
    let (photons, seeds, times) = (number(0, 100_000), number(1, 5), number(2, 100));
    let folder = arguments.get(3).map(Path::new);
    let passes = PASSES;
    let methods = [
        ("nearest 50", Density::Nearest { count: 50 }),
        ("nearest 500", Density::Nearest { count: 500 }),
        ("adaptive 5", Density::Adaptive { passes, first: 5 }),
        ("adaptive 20", Density::Adaptive { passes, first: 20 }),
    ];
    println!("{:18}{}", "scene", methods.map(|(name, _)| format!("{name:>22}")).concat());
    let mut logs = vec![0.0; methods.len()];
    let places = scenes::all(SIZE);
    for place in &places {
        let settings = |seed, samples| Settings {
            samples,
            seed,
            pixels: Pixels::Middle,
            ..Settings::default()
        };
        let image = |seed, photons, density| {
            let caustics = Caustics { photons, density, ..Caustics::default() };
            // Once reflected, and seen directly: what mirrors show is as noisy as their rays are few.
            let settings = Settings { bounces: Some(1), ..settings(seed, 1) };
            photon_image(&place.scene, &place.view, &settings, &caustics, Watch::default())
                .expect("nothing interrupts")
        };
        let exact = Density::Adaptive { passes: times, first: 20 };
        let reference = image(1 << 40, photons.saturating_mul(times), exact);
        let mut line = format!("{:18}", place.name);
        for ((name, density), log) in methods.iter().zip(&mut logs) {
            let mut errors: Vec<f64> = (0..u64::from(seeds))
                .map(|seed| {
                    let image = image(seed, photons, *density);
                    if let Some(folder) = folder.filter(|_| seed == 0) {
                        save(folder, &format!("{} {name}", place.name), &image, &reference);
                    }
                    error(&image, &reference)
                })
                .collect();
            errors.sort_by(f64::total_cmp);
            let median = errors[errors.len() / 2];
            *log += median.ln() / places.len() as f64;
            let range = format!("{:.3}-{:.3}", errors[0], errors[errors.len() - 1]);
            line += &format!("{median:>9.3}{range:>13}");
        }
        println!("{line}");
        if let Some(folder) = folder {
            save(folder, &format!("{} reference", place.name), &reference, &reference);
            let settings = settings(0, 64);
            let caustics = Caustics { photons: photons.saturating_mul(10), ..Caustics::default() };
            let watch = Watch::default();
            let split =
                render(&place.scene, &place.view, &settings, &caustics, watch).expect("done");
            let paths = path_trace(&place.scene, &place.view, &settings, watch).expect("done");
            save(folder, &format!("{} split", place.name), &split.full(), &split.full());
            save(folder, &format!("{} paths", place.name), &paths.full(), &split.full());
        }
    }
    let means = logs.iter().map(|log| format!("{:>9.3}{:13}", log.exp(), "")).collect::<String>();
    println!("{:18}{means}", "geometric mean");
}

/// Root of the mean squared difference over the mean of `reference`.
fn error(image: &Radiance, reference: &Radiance) -> f64 {
    let pairs = image.rgb.iter().flatten().zip(reference.rgb.iter().flatten());
    let squares: f64 = pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    (squares / (3 * image.rgb.len()) as f64).sqrt() / reference.mean()
}

/// Saves a picture, exposed as `like` would be.
fn save(folder: &Path, name: &str, image: &Radiance, like: &Radiance) {
    let picture = tone::display(image, tone::middle_grey_ev100(like) + 1.5);
    let bytes = picture.rgb.concat();
    let file = folder.join(format!("{}.png", name.replace(' ', "-")));
    image::RgbImage::from_raw(image.width, image.height, bytes)
        .expect("as many bytes as pixels")
        .save(file)
        .expect("a folder to write to");
}

//! What guiding buys: mean squared error at equal time, against unguided paths, on one thread.
//!
//! `cargo run -p frugal_trace --example guiding -- [SAMPLES [SEEDS [SCENE [FIRST_SEED [FOLDER]]]]]`, on
//! Linux. FOLDER gets the pictures of the first seed.
//!
//! Images of several seeds are rendered in turn. Their variance is the mean squared error, since all
//! means are equal; it is divided by the squared mean. The gain is error × processor time without a
//! guide ÷ the same with it. `local` is the same with each pixel's error divided by the squared mean
//! of its tile, so that edges of bright surfaces do not hide dark walls. A variance that rare bright
//! paths dominate is underestimated where they did not occur, most of all without a guide.

mod model;
mod scenes;
#[path = "../common/timing.rs"]
mod timing;

use std::path::Path;

use frugal_trace::integrator::{Guide, Settings, Watch, render};
use frugal_trace::metrics::{Radiance, tone};
use glam::UVec2;
use rayon::prelude::*;
use timing::timed;

const SIZE: UVec2 = UVec2::new(64, 48);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u32| {
        arguments.get(i).map_or(default, |text: &String| text.parse().expect("a whole number"))
    };
    let (samples, seeds) = (number(0, 256), number(1, 2));
    let first = number(3, 0);
    let folder = arguments.get(4).map(Path::new);
    let wanted = arguments.get(2).map_or("", String::as_str);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let guides = [Guide::None, Guide::Photons];
    for place in scenes::all(SIZE).iter().filter(|place| place.name.contains(wanted)) {
        let mut runs: Vec<(Vec<Radiance>, f64)> = vec![(Vec::new(), 0.0); guides.len()];
        for seed in first..first + seeds {
            for (guide, (images, seconds)) in guides.iter().zip(&mut runs) {
                let settings = Settings {
                    samples,
                    guide: *guide,
                    seed: u64::from(seed),
                    ..Settings::default()
                };
                let (image, spent) = one.install(|| {
                    timed(|| render(&place.scene, &place.view, &settings, Watch::default()))
                });
                *seconds += spent / f64::from(seeds);
                images.push(image.expect("nothing interrupts").full());
            }
        }
        if let Some(folder) = folder {
            let exposure = tone::middle_grey_ev100(&runs[1].0[0]);
            for (guide, (images, _)) in guides.iter().zip(&runs) {
                let file = format!("{} {guide:?}.png", place.name).replace(' ', "-");
                let picture = tone::display(&images[0], exposure);
                picture.write_png(&folder.join(file)).expect("a folder that can be written to");
            }
        }
        let means = tile_means(&runs[runs.len() - 1].0);
        let even = vec![1.0; means.len()];
        let unguided = spread(&runs[0].0, &even) * runs[0].1;
        let unguided_local = spread(&runs[0].0, &means) * runs[0].1;
        for (guide, (images, seconds)) in guides.iter().zip(&runs) {
            let mean = images.iter().map(Radiance::mean).sum::<f64>() / images.len() as f64;
            let error = spread(images, &even);
            let local = spread(images, &means);
            println!(
                "{:18} {:8} {:8} mean {mean:9.3} nits  {seconds:6.2} s  error {:9.6}  gain {:7.2}  local {local:9.5} gain {:7.2}",
                place.name,
                if place.is_indirect { "indirect" } else { "open" },
                format!("{guide:?}"),
                error / (mean * mean),
                unguided / (error * seconds),
                unguided_local / (local * seconds)
            );
        }
    }
}

/// Mean over the pixels of the variance between images ÷ the squared `scale` of each pixel.
fn spread(images: &[Radiance], scale: &[f64]) -> f64 {
    let count = images.len() as f64;
    let pixels = images[0].rgb.len();
    let sum: f64 = (0..pixels)
        .into_par_iter()
        .map(|i| {
            let sum: f64 = (0..3)
                .map(|channel| {
                    let values = images.iter().map(|image| f64::from(image.rgb[i][channel]));
                    let mean = values.clone().sum::<f64>() / count;
                    values.map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0)
                })
                .sum();
            sum / scale[i].powi(2)
        })
        .sum();
    sum / (3 * pixels) as f64
}

/// For each pixel, the mean of the tile of 8 × 8 pixels that it lies in, over all images.
fn tile_means(images: &[Radiance]) -> Vec<f64> {
    let tile = |i: usize| (i % SIZE.x as usize) / 8 + 8 * (i / SIZE.x as usize / 8);
    let mut tiles = vec![(0.0, 0.0); 64];
    for image in images {
        for (i, rgb) in image.rgb.iter().enumerate() {
            let (sum, count) = &mut tiles[tile(i)];
            *sum += f64::from(rgb[0] + rgb[1] + rgb[2]) / 3.0;
            *count += 1.0;
        }
    }
    (0..images[0].rgb.len()).map(|i| tiles[tile(i)].0 / tiles[tile(i)].1).collect()
}

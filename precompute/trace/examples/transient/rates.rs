//! How fast errors fall.

use std::f64::consts::TAU;

use frugal_trace::integrator::{Settings, Watch};
use frugal_trace::time::{
    SPEED_OF_LIGHT, Spread, Window, bandwidth, frames, progressive, sample_distance,
};
use glam::{DVec3, UVec2};

use crate::camera;

/// Frames at which values are compared; a window of indirect light, metres.
const FRAMES: u32 = 48;
const METRES: [f64; 2] = [5.0, 14.0];

/// Slopes of progressive kernels and of bins of the best exponent. The truth is a kernel estimate
/// of many more paths with narrow kernels; the pixel sees no light directly in the window.
pub(crate) fn slopes(seed: u64) -> Vec<(&'static str, f64)> {
    let scene = camera::corner(0.6);
    let view = frugal_trace::integrator::View { size: UVec2::new(4, 3), ..camera::view() };
    let settings =
        |samples, seed| Settings { samples, bounces: Some(4), seed, ..Settings::default() };
    let window = |frames| Window {
        start: METRES[0] / SPEED_OF_LIGHT,
        end: METRES[1] / SPEED_OF_LIGHT,
        frames,
        at_surfaces: false,
    };
    let (wide, watch) = (0.7 / SPEED_OF_LIGHT, Watch::default());
    let truth = {
        let spread = Spread::Kernel(0.12 / SPEED_OF_LIGHT);
        let settings = settings(1 << 16, 999);
        frames(&scene, &view, &settings, window(FRAMES), spread, watch).expect("a window").1
    };
    let counts = [64_u32, 128, 256, 512, 1024, 2048];
    let error = |values: &[[f32; 3]]| -> f64 {
        values.iter().zip(&truth.values).map(|(a, b)| f64::from(a[1] - b[1]).powi(2)).sum()
    };
    let (mut kernels, mut bins) = (Vec::new(), Vec::new());
    for count in counts {
        let (mut sum, mut binned) = (0.0, 0.0);
        for repeat in 0..3 {
            let seed = 1000 * (seed + 1) + 10 * u64::from(count) + repeat;
            let few = settings(8, seed);
            let found = progressive(&scene, &view, &few, window(FRAMES), wide, count / 8, watch);
            sum += error(&found.expect("a window").values);
            // Bins whose number grows as n^(1/3), looked up at the same times.
            let number = (3.0 * f64::from(count).cbrt()).round() as u32;
            let found =
                frames(&scene, &view, &settings(count, seed), window(number), Spread::Bins, watch);
            let found = found.expect("a window").1;
            let values: Vec<[f32; 3]> = (0..truth.values.len())
                .map(|i| {
                    let (pixel, frame) = (i / FRAMES as usize, i % FRAMES as usize);
                    let bin = (frame as f64 + 0.5) / f64::from(FRAMES) * f64::from(number);
                    found.values[pixel * number as usize + bin as usize]
                })
                .collect();
            binned += error(&values);
        }
        kernels.push((f64::from(count).ln(), sum.ln()));
        bins.push((f64::from(count).ln(), binned.ln()));
    }
    let ratio = (bins[5].1 - kernels[5].1).exp();
    vec![
        ("progressive kernels (theory -0.8)", slope(&kernels)),
        ("bins, width n^(-1/3) (theory -0.667)", slope(&bins)),
        ("error of bins / of kernels at 2048 paths", ratio),
        ("last bandwidth / first", bandwidth(1.0, 255)),
    ]
}

fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let x = points.iter().map(|point| point.0).sum::<f64>() / n;
    let y = points.iter().map(|point| point.1).sum::<f64>() / n;
    points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum::<f64>()
        / points.iter().map(|point| (point.0 - x).powi(2)).sum::<f64>()
}

/// A ray past a point light in fog: distances by transmittance, by angle, and uniform in time, with
/// the same number of samples; each frame's error relative to its own light.
pub(crate) fn fog(seed: u64) -> Vec<(&'static str, f64)> {
    let fogs = [
        (0.2, ["scattering 0.2/m: by transmittance", "  equiangular", "  uniform in time"]),
        (0.9, ["scattering 0.9/m: by transmittance", "  equiangular", "  uniform in time"]),
        (1.5, ["scattering 1.5/m: by transmittance", "  equiangular", "  uniform in time"]),
    ];
    let mut rows = Vec::new();
    for (scattering, names) in fogs {
        let errors = errors(scattering, seed);
        rows.extend(names.into_iter().zip(errors));
        rows.push(("  transmittance / uniform", errors[0] / errors[2]));
        rows.push(("  equiangular / uniform", errors[1] / errors[2]));
    }
    rows
}

/// Errors with distances by transmittance, equiangular ones, and ones uniform in time.
fn errors(scattering: f64, seed: u64) -> [f64; 3] {
    let (light, direction) = (DVec3::new(0.6, 0.2, -2.0), DVec3::NEG_Z);
    let extinction = scattering + 0.1;
    let (from, to, frames, samples) = (light.length(), 12.0, 64_usize, 2048);
    let way = |r: f64| r + (light - direction * r).length();
    let radiance = |r: f64| {
        let rest = (light - direction * r).length_squared();
        scattering / (2.0 * TAU) * (-extinction * way(r)).exp() / rest
    };
    let width = (to - from) / frames as f64;
    // Per metre of way, by the distance that has that way.
    let exact: Vec<f64> = (0..frames)
        .map(|frame| {
            let mean = (0..256).map(|i| {
                let x = (frame as f64 + (f64::from(i) + 0.5) / 256.0) / frames as f64;
                let (r, density) = sample_distance(light, direction, [from, to], x).expect("a way");
                radiance(r) / density / (to - from)
            });
            mean.sum::<f64>() / 256.0
        })
        .collect();
    // No multiple of the step below: all seeds would share their numbers, one place apart.
    let mut state = seed.wrapping_add(1).wrapping_mul(0xd134_2543_de82_ef95);
    let mut number = || {
        // SplitMix64: the tracer's own sampler is private.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (along, most) = (light.dot(direction), 20.0_f64);
    let aside = (light.length_squared() - along * along).sqrt();
    let mut measure = |sample: &dyn Fn(f64) -> Option<(f64, f64)>| {
        let mut sum = 0.0;
        for _ in 0..16 {
            let mut image = vec![0.0; frames];
            for _ in 0..samples {
                let Some((r, density)) = sample(number()) else { continue };
                let place = (way(r) - from) / width;
                if place < frames as f64 {
                    image[place as usize] += radiance(r) / density / (f64::from(samples) * width);
                }
            }
            let errors = image.iter().zip(&exact).map(|(own, exact)| (own / exact - 1.0).powi(2));
            sum += errors.sum::<f64>() / frames as f64 / 16.0;
        }
        sum
    };
    let exponential = measure(&|x| {
        let r = -(1.0 - x).ln() / extinction;
        Some((r, extinction * (-extinction * r).exp()))
    });
    let equiangular = measure(&|x| {
        let (a, b) = ((-along / aside).atan(), ((most - along) / aside).atan());
        let step = aside * (a + x * (b - a)).tan();
        Some((along + step, aside / ((b - a) * (aside * aside + step * step))))
    });
    let uniform = measure(&|x| sample_distance(light, direction, [from, to], x));
    [exponential, equiangular, uniform]
}

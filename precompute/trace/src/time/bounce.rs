//! What a time-of-flight camera can know of its multipath error: light of two bounces, both at
//! places that it sees.
//!
//! Fuchs 2010, "Multipath Interference Compensation in Time-of-Flight Camera Images": what the
//! camera measured gives positions, and with a light at the eye the reflectance. From both follows
//! the light that surfaces send each other, which is subtracted. Each pixel is a virtual point
//! light, as in a renderer's sum over them. Quadratic in the number of pixels.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::film::{TimeError, positive};
use super::flight::{Capture, phasor};

/// A place that a pixel stands for.
#[derive(Clone, Copy)]
struct Patch {
    position: DVec3,
    normal: DVec3,
    /// Metres from the eye.
    distance: f64,
    /// Direct light that the pixel shows, nits.
    radiance: f64,
    /// Reflected radiance ÷ illuminance.
    reflectance: f64,
    /// m².
    area: f64,
}

/// The phasors of all light in `capture` without the light of two bounces, in `rounds` rounds: each
/// takes off what follows from the last one's distances. `candela` is the luminous intensity of a
/// light at the eye, the same in all directions. Pixels without a neighbour in both directions or
/// without light keep their phasors.
///
/// # Errors
/// When `candela` is not finite or not above 0.
pub fn without_bounce(
    capture: &Capture,
    candela: f64,
    rounds: u32,
) -> Result<Vec<DVec2>, TimeError> {
    positive(candela)?;
    let mut direct = capture.all.clone();
    for _ in 0..rounds {
        let patches = patches(capture, &direct, candela);
        direct = (0..direct.len())
            .into_par_iter()
            .map(|pixel| {
                let Some(own) = &patches[pixel] else { return capture.all[pixel] };
                let others = patches.iter().enumerate().filter(|(other, _)| *other != pixel);
                let bounced: DVec2 = others
                    .filter_map(|(_, other)| other.as_ref())
                    .map(|other| bounce(own, other, capture.frequency))
                    .sum();
                capture.all[pixel] - bounced
            })
            .collect();
    }
    Ok(direct)
}

/// Light eye → `from` → `to` → eye.
fn bounce(to: &Patch, from: &Patch, frequency: f64) -> DVec2 {
    let ray = from.position - to.position;
    let squared = ray.length_squared();
    let distance = squared.sqrt();
    let cosines = (ray.dot(to.normal) * -ray.dot(from.normal)).max(0.0);
    if cosines <= 0.0 || ray.dot(to.normal) <= 0.0 {
        return DVec2::ZERO;
    }
    // A patch as a disc: a point would be infinitely bright at its neighbours.
    let form = cosines / (squared * (squared + from.area / std::f64::consts::PI));
    let light = from.radiance * from.area * form * to.reflectance;
    phasor(light, to.distance + distance + from.distance, frequency)
}

/// Means over 5 × 5 pixels, of depths within a tenth of the middle one's: noise of a few centimetres
/// turns normals that neighbours give by right angles.
fn smoothed(depths: &[Option<f64>], width: usize) -> Vec<Option<f64>> {
    let height = depths.len() / width;
    let near = |at: usize, end: usize| at.saturating_sub(2)..(at + 3).min(end);
    let mean = |pixel: usize| {
        let own = depths[pixel]?;
        let (mut sum, mut count) = (0.0, 0.0);
        for y in near(pixel / width, height) {
            for other in near(pixel % width, width).filter_map(|x| depths[y * width + x]) {
                if (other - own).abs() <= 0.1 * own {
                    (sum, count) = (sum + other, count + 1.0);
                }
            }
        }
        Some(if count > 0.0 { sum / count } else { own })
    };
    (0..depths.len()).map(mean).collect()
}

fn patches(capture: &Capture, direct: &[DVec2], candela: f64) -> Vec<Option<Patch>> {
    // Not 0, which an empty image has.
    let width = capture.width.max(1);
    let depths = smoothed(&capture.depths(direct), width);
    let height = depths.len() / width;
    let position = |pixel: usize| Some(capture.rays[pixel] * depths[pixel]?);
    // The difference to the nearer neighbour in depth, which is more often on the same surface.
    let slope = |pixel: usize, step: usize, before: bool, after: bool| {
        let own = position(pixel)?;
        let back = before.then(|| position(pixel - step)).flatten().map(|other| own - other);
        let ahead = after.then(|| position(pixel + step)).flatten().map(|other| other - own);
        [back, ahead]
            .into_iter()
            .flatten()
            .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    };
    (0..depths.len())
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            let across = slope(pixel, 1, x > 0, x + 1 < width)?;
            let down = slope(pixel, width, y > 0, y + 1 < height)?;
            let normal = down.cross(across).normalize_or_zero();
            let ray = capture.rays[pixel];
            let normal = if normal.dot(ray) > 0.0 { -normal } else { normal };
            let distance = depths[pixel]?;
            let cosine = -normal.dot(ray);
            let radiance = direct[pixel].length();
            let illuminance = candela * cosine / (distance * distance);
            let patch = Patch {
                position: ray * distance,
                normal,
                distance,
                radiance,
                // A surface reflects no more than it receives, however steep it seems.
                reflectance: (radiance / illuminance).min(std::f64::consts::FRAC_1_PI),
                area: capture.solid_angle(pixel) * distance * distance / cosine.max(0.05),
            };
            let is_sound = distance > 0.0 && cosine > 0.0 && patch.reflectance.is_finite();
            is_sound.then_some(patch)
        })
        .collect()
}

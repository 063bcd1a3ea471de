//! What a guide would gain, before an image.

use rayon::prelude::*;

use super::path::{Arrival, Record, trace};
use super::{ReferenceScene, Settings, View};
use crate::color::luminance;
use crate::guide::Field;
use crate::sampler::Sampler;

/// Pairs of paths per path of the image that find out what a guide gains, limits to their number, and
/// how many are traced one after the other.
const TRIALS_PER_PATH: f64 = 0.005;
const FEWEST_TRIALS: f64 = 1024.0;
const MOST_TRIALS: f64 = 65_536.0;
const TRIALS: u32 = 128;
/// Random numbers that are neither those of the image nor those of photons.
const SEED: u64 = 0x6a09_e667_f3bc_c909;

/// Variance × time of an image without `field` ÷ that with it, from few paths.
///
/// Guided paths tell both: where a path is `odds` times as likely without a guide, its light has
/// 1 ÷ odds times the second moment there. Unguided ones would miss what is rare and bright.
pub(super) fn gain(scene: &ReferenceScene, view: &View, settings: &Settings, field: &Field) -> f64 {
    let paths = f64::from(view.size.element_product()) * f64::from(settings.samples);
    let count = (paths * TRIALS_PER_PATH).clamp(FEWEST_TRIALS, MOST_TRIALS);
    let settings = Settings { seed: settings.seed.wrapping_add(SEED), ..*settings };
    let chunks: Vec<Change> = (0..(count / f64::from(TRIALS)).ceil() as u64)
        .into_par_iter()
        .map(|chunk| {
            let mut sum = Change::default();
            for trial in 0..TRIALS {
                let mut sampler = Sampler::new(settings.seed, chunk, trial);
                let size = view.size.as_dvec2().to_array();
                let place = sampler.pair();
                let pixel = [0, 1].map(|axis| (place[axis] * size[axis]).floor());
                let lights: [f64; 2] = std::array::from_fn(|_| {
                    let [x, y] = sampler.pair();
                    let (origin, direction) = view.ray(pixel[0] + x, pixel[1] + y);
                    sum.lights.clear();
                    trace(scene, &settings, Some(field), origin, direction, &mut sampler, &mut sum);
                    sum.finish()
                });
                sum.variance += (lights[0] - lights[1]).powi(2);
            }
            sum
        })
        .collect();
    // The median, because one rare bright path can outweigh all others.
    let mut gains: Vec<f64> = chunks.iter().map(Change::gain).collect();
    gains.sort_unstable_by(f64::total_cmp);
    gains[gains.len() / 2]
}

/// What a guide changes, summed over paths.
#[derive(Clone, Debug, Default)]
struct Change {
    /// Luminances that the last path brought, nits, and what unguided paths would bring more rarely.
    lights: Vec<[f64; 2]>,
    /// Variance within a pixel, and what the guide takes from it.
    variance: f64,
    saved: f64,
    /// Surfaces that guided and unguided paths meet.
    guided: f64,
    unguided: f64,
}

impl Change {
    /// Variance × time unguided ÷ that guided; NaN where there is no light.
    fn gain(&self) -> f64 {
        (1.0 + self.saved / self.variance) * (self.unguided / self.guided)
    }

    /// Ends a path and returns its light. Where a guided path brings a sum of lights, an unguided one
    /// would bring one of them: what counts is by how much that exceeds the sum.
    fn finish(&mut self) -> f64 {
        let sum = self.lights.iter().map(|light| light[0]).sum::<f64>();
        let saved = self.lights.iter().map(|light| light[0] * (light[1] - sum).max(0.0));
        self.saved += saved.sum::<f64>();
        sum
    }
}

impl Record for Change {
    fn met(&mut self, odds: f64) {
        self.guided += 1.0;
        self.unguided += odds;
    }

    fn arrived(&mut self, arrival: Arrival) {
        let light = luminance(arrival.light);
        self.lights.push([light, light / arrival.odds]);
    }
}

//! What a calibration reads, in an order of which any beginning tells all prices.

use frugal_core::knobs::{KnobLevels, KnobSpace};
use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;

use crate::search::random_settings;

/// Readings at a camera before the next one. Higher values reach fewer cameras in a minute; lower values
/// spend more of it on references, which every change of the camera renders anew.
const PER_CAMERA: usize = 8;

/// Cameras and settings to read, without end: the best and the cheapest settings, then by turns one
/// with a single knob changed and a random one, from camera to camera. `cameras`: how many there are, at
/// least 1. Deterministic in `seed`.
///
/// Settings with one knob changed from the best or the cheapest tell prices apart at both ends, random
/// ones between them, where maps choose.
pub fn reading_plan(
    space: &KnobSpace,
    cameras: usize,
    seed: u64,
) -> impl Iterator<Item = (usize, KnobLevels)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut single = single_changes(space);
    single.shuffle(&mut random);
    (0_usize..).map(move |step| {
        let settings = match step {
            0 => space.highest(),
            1 => space.canonical(space.lowest()),
            _ if step.is_multiple_of(2) => single[(step / 2) % single.len()],
            _ => space.canonical(random_settings(space, &mut random)),
        };
        (step / PER_CAMERA % cameras.max(1), settings)
    })
}

/// The best and the cheapest settings with one knob at each of its levels.
fn single_changes(space: &KnobSpace) -> Vec<KnobLevels> {
    let ends = [space.highest(), space.lowest()];
    let knobs = space.knobs().iter().enumerate();
    let levels = knobs.flat_map(|(knob, it)| (0..it.levels.len()).map(move |level| (knob, level)));
    space.canonical_once(
        levels.flat_map(|(knob, level)| ends.map(|settings| settings.with_level(knob, level))),
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use frugal_core::units::Watts;
    use rand::RngExt as _;

    use super::*;
    use crate::cost::{CostModel, CostReading, FrameLayout, Work, work_names};

    const LAYOUT: FrameLayout =
        FrameLayout { size: [1920, 1080], maps: 1, point_lights: 0, has_sky: true };
    const CAMERAS: usize = 6;

    /// Watts of a large board, as metered, with every knob's work at a price.
    fn power(space: &KnobSpace, settings: KnobLevels) -> f64 {
        let price = |name: &str| match name {
            "frame" => 10.0,
            "pixels" => 3e-6,
            "upscaled pixels" => 5e-6,
            "gathered pixels" => 4e-6,
            "pairs" => 3e-8,
            "rays" => 6e-7,
            "VPLs" => 8e-4,
            "shadow texels" => 3e-7,
            "cascades" => 0.9,
            "occlusion samples" => 2e-7,
            "SMAA pixels" => 4e-6,
            "bloom texels" => 3e-6,
            _ => 1e-7,
        };
        let work = Work::of(space, settings, &LAYOUT).0;
        work_names(space).iter().zip(&work).map(|(name, work)| work * price(name)).sum()
    }

    /// Uniform in ±`most`.
    fn noise(random: &mut ChaCha8Rng, most: f64) -> f64 {
        random.random_range(-most..most)
    }

    /// Mean error of the power of unread settings, from `count` readings.
    fn error(
        space: &KnobSpace,
        plan: impl Iterator<Item = (usize, KnobLevels)>,
        count: usize,
        seed: u64,
    ) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
        let cameras: Vec<f64> = (0..CAMERAS).map(|_| noise(&mut random, 0.15)).collect();
        let mean = (cameras.iter().sum::<f64>() / CAMERAS as f64).exp();
        let readings: Vec<CostReading> = plan
            .take(count)
            .map(|(camera, settings)| CostReading {
                camera,
                work: Work::of(space, settings, &LAYOUT),
                power_w: power(space, settings)
                    * (cameras[camera] + noise(&mut random, 0.087)).exp(),
            })
            .collect();
        let model = CostModel::fit(&readings, Watts(0.0));
        let unread = reading_plan(space, 1, 5000 + seed).skip(2).take(100);
        let off = unread.map(|(_, settings)| {
            (model.power(&Work::of(space, settings, &LAYOUT)) / (mean * power(space, settings))
                - 1.0)
                .abs()
        });
        off.sum::<f64>() / 100.0
    }

    #[test]
    fn a_minute_of_readings_tells_all_prices() {
        let space = crate::testing::knobs();
        let mean = |error: &dyn Fn(u64) -> f64| (0..6).map(error).sum::<f64>() / 6.0;
        let planned = mean(&|seed| error(&space, reading_plan(&space, CAMERAS, seed), 60, seed));
        let single = mean(&|seed| {
            let one = single_changes(&space);
            error(&space, one.into_iter().cycle().map(|it| (0, it)), 60, seed)
        });
        assert!(planned < 0.04 && single > 1.5 * planned, "{planned} and {single}");
    }

    #[test]
    fn a_plan_begins_at_both_ends_and_is_the_same_for_a_seed() {
        let space = crate::testing::knobs();
        let first = |seed| reading_plan(&space, CAMERAS, seed).take(300).collect::<Vec<_>>();
        let plan = first(1);
        assert_eq!(plan[..2], [(0, space.highest()), (0, space.canonical(space.lowest()))]);
        assert!(plan.iter().all(|(_, settings)| space.canonical(*settings) == *settings));
        assert_eq!(plan, first(1));
        assert_ne!(plan, first(2));
        // The first 60 have every camera, and every knob at several levels.
        let cameras: BTreeSet<usize> = plan[..60].iter().map(|(camera, _)| *camera).collect();
        assert!(cameras.into_iter().eq(0..CAMERAS));
        for (knob, it) in space.knobs().iter().enumerate() {
            let levels: BTreeSet<usize> = plan[..60].iter().map(|(_, it)| it.level(knob)).collect();
            assert!(levels.len() >= it.levels.len().min(4), "{}: {levels:?}", it.name);
        }
    }

    #[test]
    fn a_space_of_one_knob_or_one_level_has_a_plan() {
        for levels in [vec![0.0], vec![0.0, 1.0]] {
            let knob = frugal_core::knobs::Knob::new("k", levels);
            let space = KnobSpace::new(vec![knob]).expect("a valid space");
            assert_eq!(reading_plan(&space, 0, 0).take(9).count(), 9);
        }
    }
}

//! A model of rendering costs.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};

use super::{Problem, SearchConfig, frontier_of, random_search, search};

/// Seven rendering knobs, 16,128 names for 13,536 images: multiplicative costs, errors that mask
/// one another, and one knob without effect.
pub(super) fn rendering_space() -> KnobSpace {
    let levels = |count: u32| (0..count).map(f64::from);
    KnobSpace::new(vec![
        Knob::new("vpl_count", levels(7)),
        Knob::new("visibility", levels(3)).needing("vpl_count", 1),
        Knob::new("pixel_share", levels(4)).needing("vpl_count", 1),
        Knob::new("shadows", levels(4)),
        Knob::new("antialiasing", levels(6)),
        Knob::new("scale", levels(4)),
        Knob::new("idle", levels(2)),
    ])
    .expect("a valid space")
}

pub(super) fn rendering(settings: KnobLevels) -> CostPoint {
    let level = |knob: usize| settings.level(knob) as f64;
    let pixels = (0.5 + level(5) / 6.0).powi(2);
    let lights = if settings.level(0) == 0 { 0.0 } else { 2_f64.powf(level(0)) / 64.0 };
    let gi = lights * (0.3 + 0.35 * level(1)) * 2_f64.powf(level(2) - 3.0) * 6.0;
    // The second antialiasing costs more than the third, as measured filters do.
    let filter = [0.0, 0.5, 0.3, 0.4, 0.6, 0.8][settings.level(4)];
    let power = 2.0 + pixels * (1.0 + gi + filter) + 0.2 * 2_f64.powf(level(3));
    let lost = |share: f64, weight: f64| weight * share.powf(1.5);
    let gi_error = if settings.level(0) == 0 {
        0.12
    } else {
        lost(1.0 - level(0) / 6.0, 0.08)
            + lost(1.0 - level(1) / 2.0, 0.02)
            + lost(1.0 - level(2) / 3.0, 0.03)
    };
    let kept = (1.0 - gi_error)
        * (1.0 - lost(1.0 - level(3) / 3.0, 0.04))
        * (1.0 - lost(1.0 - level(4) / 5.0, 0.03))
        * (1.0 - lost(1.0 - level(5) / 3.0, 0.15));
    CostPoint::new(power, 1.0 - kept)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn few_evaluations_find_most_of_a_rendering_frontier() {
    let space = rendering_space();
    let reference =
        CostPoint::new(rendering(space.highest()).power.0, rendering(space.lowest()).error);
    let exact = frontier_of(space.iter(), rendering);
    let best = exact.hypervolume(reference);
    let mut lines = Vec::new();
    for evaluations in [15, 30, 60, 120, 240, 480] {
        let (mut cold, mut warm, mut random) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 0..11 {
            let config = SearchConfig {
                seed,
                max_evaluations: Some(evaluations),
                ..SearchConfig::default()
            };
            let mut problem = Problem::new(rendering);
            cold.push(
                search(&space, &mut problem, &[], config.clone()).frontier.hypervolume(reference)
                    / best,
            );
            assert_eq!(problem.evaluated.len(), evaluations);
            // A neighbour that was searched with as small a budget.
            let mut neighbour = Problem::new(|settings| {
                rendering(settings.with_level(3, settings.level(3).max(1)))
            });
            let inherit = search(
                &space,
                &mut neighbour,
                &[],
                SearchConfig { seed: seed + 100, ..config.clone() },
            )
            .frontier;
            let inherit: Vec<_> = inherit.points().iter().map(|point| point.settings).collect();
            warm.push(
                search(&space, &mut Problem::new(rendering), &inherit, config)
                    .frontier
                    .hypervolume(reference)
                    / best,
            );
            random.push(
                random_search(&space, evaluations, seed, rendering).hypervolume(reference) / best,
            );
        }
        lines.push((evaluations, [median(cold), median(warm), median(random)]));
    }

    for (evaluations, [cold, warm, random]) in lines {
        let least = match evaluations {
            ..30 => 0.0,
            30 => 0.9,
            60 => 0.95,
            120 => 0.97,
            240 => 0.985,
            _ => 0.99,
        };
        assert!(cold > least && warm > least, "{evaluations}: {cold} {warm}");
        assert!(cold > random && warm > random, "{evaluations}: {cold} {warm} random {random}");
    }
}

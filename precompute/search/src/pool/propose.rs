//! Proposals for rendering: NSGA-II on the models of power and error, without rendering.

use frugal_core::frontier::{CostPoint, FrontierPoint};
use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::{ErrorModel, LEAST_ERROR, Screening, scores};
use crate::search::nsga2;

/// Errors are clamped to this: no budget allows more, so settings beyond it differ in power alone.
const GREATEST_ERROR: f64 = 0.3;
/// Optimism of proposals, standard deviations below the expected error (a lower confidence bound).
const OPTIMISM: f64 = 0.5;
/// The same where too little is expected to gain: the search goes on where the model knows least.
const EXPLORATION: f64 = 3.0;
/// Least gain, summed over goals, for which settings are rendered.
const LEAST_GAIN: f64 = 1e-3;

/// Up to `count` unrendered settings with the greatest expected gain, in the range of error
/// budgets. Where the expected gain is too small for so many, the most uncertain ones follow.
/// Deterministic in `seed`. `power`: of any settings; `errors`: means of rendered ones.
pub(crate) fn propose(
    space: &KnobSpace,
    screening: &Screening,
    power: &dyn Fn(KnobLevels) -> f64,
    errors: &[(KnobLevels, f64)],
    (count, seed): (usize, u64),
) -> Vec<KnobLevels> {
    let error = ErrorModel::fit(space, screening, errors);
    let known: Vec<KnobLevels> =
        errors.iter().map(|(settings, _)| screening.fixed(space, *settings)).collect();
    let best_power = power(space.highest()).max(1e-9);
    let rendered = errors.iter().filter(|(_, error)| error.is_finite());
    let mut rendered: Vec<(KnobLevels, CostPoint)> = rendered
        .map(|(settings, error)| (*settings, CostPoint::new(power(*settings) / best_power, *error)))
        .collect();
    let point = |point: &FrontierPoint| {
        let error = (point.cost.error.exp() - LEAST_ERROR).max(0.0);
        (point.settings, CostPoint::new(point.cost.power.0.exp() / best_power, error))
    };
    // Both models, in logarithms, so that crowding and dominance resolve the range of budgets.
    let objectives = |settings: KnobLevels, optimism: f64| {
        let power = power(settings).max(1e-9).ln();
        // A knob without effect stays at its cheapest, however little power that saves.
        if screening.fixed(space, settings) != space.canonical(settings) {
            return CostPoint::new(power + 1.0, GREATEST_ERROR.ln() + 1.0);
        }
        let (mean, deviation) = error.predict(settings);
        let error = mean - optimism * deviation;
        let error = error.clamp(LEAST_ERROR.ln(), (GREATEST_ERROR + LEAST_ERROR).ln());
        CostPoint::new(power, error)
    };
    let cheapest = power(space.lowest()) / best_power;
    let mut proposed = Vec::new();
    for optimism in [OPTIMISM, EXPLORATION] {
        let found = nsga2(space, seed, &known, &mut |settings| objectives(settings, optimism));
        let candidates: Vec<_> = found.points().iter().map(point).collect();
        let more = greatest_gains(&rendered, &candidates, cheapest, count - proposed.len());
        proposed.extend(more.iter().map(|(settings, _)| *settings));
        if proposed.len() == count {
            break;
        }
        rendered.extend(more);
    }
    proposed
}

/// The candidates of greatest gain in scores, summed over goals, each given those before it. Powers are
/// shares of the best settings' power; `cheapest`: the least of all settings.
fn greatest_gains(
    rendered: &[(KnobLevels, CostPoint)],
    candidates: &[(KnobLevels, CostPoint)],
    cheapest: f64,
    count: usize,
) -> Vec<(KnobLevels, CostPoint)> {
    let range = cheapest..1.0;
    let reach = |least: &mut [f64], cost: &CostPoint| {
        let scores = scores(&range, cost);
        least.iter_mut().zip(scores).for_each(|(least, score)| *least = least.min(score));
    };
    // The best settings at the greatest error that counts: something to gain on where nothing is
    // rendered.
    let mut least: Vec<f64> = scores(&range, &CostPoint::new(1.0, GREATEST_ERROR)).collect();
    rendered.iter().for_each(|(_, cost)| reach(&mut least, cost));
    let mut open: Vec<&(KnobLevels, CostPoint)> = candidates
        .iter()
        .filter(|(settings, _)| rendered.iter().all(|(other, _)| other != settings))
        .collect();
    let mut taken = Vec::new();
    while taken.len() < count {
        let gain = |cost: &CostPoint| -> f64 {
            let scores = scores(&range, cost);
            least.iter().zip(scores).map(|(least, score)| (least - score).max(0.0)).sum()
        };
        let gains = open.iter().map(|(_, cost)| gain(cost)).enumerate();
        let Some((next, _)) =
            gains.filter(|(_, gain)| *gain > LEAST_GAIN).max_by(|a, b| a.1.total_cmp(&b.1))
        else {
            break;
        };
        let (settings, cost) = *open.swap_remove(next);
        reach(&mut least, &cost);
        taken.push((settings, cost));
    }
    taken
}

#[cfg(test)]
mod tests {
    use frugal_core::units::Watts;

    use super::*;
    use crate::cost::{CostModel, CostReading, FrameLayout, Work};
    use crate::pool::screening_settings;
    use crate::table::CostTable;

    #[test]
    fn proposals_are_new_and_better_than_one_knob_at_a_time() {
        let space = crate::testing::knobs();
        let layout = FrameLayout { size: [160, 90], maps: 2, point_lights: 0, has_sky: true };
        let names = crate::cost::work_names(&space);
        let price = |name: &str| match name {
            "frame" => 1.0,
            "rays" => 4e-5,
            "pairs" => 5e-7,
            "shadow texels" => 1e-7,
            "occlusion samples" => 2e-6,
            "pixels" => 5e-5,
            _ => 1e-9,
        };
        let power = |settings| {
            Work::of(&space, settings, &layout)
                .0
                .iter()
                .zip(&names)
                .map(|(work, name)| work * price(name))
                .sum::<f64>()
        };
        let error = |settings: KnobLevels| {
            let settings = space.canonical(settings);
            (0..space.len())
                .map(|knob| {
                    let top = space.knobs()[knob].levels.len() - 1;
                    let missing = (top - settings.level(knob)) as f64 / top as f64;
                    0.002 * missing * (1.0 + knob as f64)
                })
                .sum::<f64>()
        };
        let mut table = CostTable::new(1);
        let mut readings = Vec::new();
        for settings in screening_settings(&space, true) {
            table.set(0, settings, CostPoint::new(power(settings), error(settings)));
            readings.push(CostReading {
                camera: 0,
                work: Work::of(&space, settings, &layout),
                power_w: power(settings),
            });
        }
        let screening = Screening::of(&space, &table);
        let cost = CostModel::fit(&readings, Watts(0.0));
        let errors: Vec<_> =
            table.settings().iter().map(|settings| (*settings, error(*settings))).collect();
        let modelled = |settings| cost.power(&Work::of(&space, settings, &layout));
        let propose = || propose(&space, &screening, &modelled, &errors, (12, 1));
        let proposed = propose();
        assert_eq!(proposed, propose());
        assert_eq!(proposed.len(), 12);
        assert!(
            proposed.iter().all(|settings| table.column(*settings).is_none()
                && space.canonical(*settings) == *settings)
        );
        let known: Vec<KnobLevels> = table.settings().to_vec();
        let (mut of_one, mut of_all) = (0.0_f64, 0.0_f64);
        for rate in [4.0, 16.0, 64.0] {
            let loss = |settings: KnobLevels| {
                power(settings) / power(space.highest()) + rate * error(settings)
            };
            let least = |all: &[KnobLevels]| {
                all.iter().map(|settings| loss(*settings)).fold(f64::INFINITY, f64::min)
            };
            // From the best known settings, one knob after another.
            let mut best = *known
                .iter()
                .min_by(|a, b| loss(**a).total_cmp(&loss(**b)))
                .expect("rendered settings");
            for knob in (0..space.len()).cycle().take(4 * space.len()) {
                let levels = 0..space.knobs()[knob].levels.len();
                let at = |level: usize| space.canonical(best.with_level(knob, level));
                best =
                    levels.map(at).min_by(|a, b| loss(*a).total_cmp(&loss(*b))).expect("a level");
            }
            let optimum = loss(best);
            of_one = of_one.max(least(&known) / optimum);
            let all = [&known[..], &proposed[..]].concat();
            of_all = of_all.max(least(&all) / optimum);
        }
        println!("    one knob at a time {of_one:.3} of the optimum, with proposals {of_all:.3}");
        assert!(of_one > 1.1 && of_all < 1.05, "{of_one} {of_all}");
    }
}

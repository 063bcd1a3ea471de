//! Tests of the exchange rate: plays of views with known frontiers.

use proptest::prelude::*;

use super::*;
use crate::frontier::FrontierPoint;
use crate::knobs::KnobLevels;
use crate::units::Watts;

/// 1 W to 10 W, with an error of `scale` ÷ power, less that of the best.
fn frontier(scale: f64) -> Frontier {
    let point = |level: u32| {
        let power = 1.0 + 0.1 * f64::from(level);
        let cost = CostPoint::new(power, scale * (1.0 / power - 0.1));
        FrontierPoint { settings: KnobLevels::from_bits(u128::from(level)), cost }
    };
    Frontier::from_points((0..=90).map(point))
}

/// Plays views by their frontiers, each for a frame of an eighth of a second, and applies what is chosen
/// at once.
fn play(
    tracker: &mut RateTracker,
    views: impl Iterator<Item = Frontier>,
    (power, error, horizon): (Option<f64>, Option<f64>, f64),
) -> Vec<CostPoint> {
    let step = |view: Frontier| {
        tracker.begin(power, error, horizon);
        let rate = tracker.rate(&Curve::of(&view, 1.0), power, error, 1.0, 0.125);
        let within = view.points().iter().filter(|point| {
            point.cost.power <= rate.most.power && point.cost.error <= rate.most.error
        });
        let chosen = Frontier::from_points(within.copied());
        let of = |frontier: &Frontier| frontier.least_sum(rate.watts_per_error).map(|it| it.cost);
        let ends = [view.points()[0].cost, view.points()[view.points().len() - 1].cost];
        let cost = of(&chosen).unwrap_or(ends[usize::from(rate.is_by_error)]);
        tracker.spend(cost, 0.125);
        cost
    };
    views.map(step).collect()
}

fn mean(costs: &[CostPoint], of: fn(&CostPoint) -> f64) -> f64 {
    costs.iter().map(of).sum::<f64>() / costs.len() as f64
}

/// The greatest mean of 30 s.
fn worst_window(costs: &[CostPoint], of: fn(&CostPoint) -> f64) -> f64 {
    costs.windows(240).map(|window| mean(window, of)).fold(0.0, f64::max)
}

/// `seconds` of views that change between an easy and a hard one every `each` seconds.
fn turns(seconds: usize, each: usize) -> impl Iterator<Item = Frontier> {
    let [easy, hard] = [0.02, 0.4].map(frontier);
    (0..8 * seconds).map(move |frame| {
        if (frame / (8 * each)).is_multiple_of(2) { easy.clone() } else { hard.clone() }
    })
}

#[test]
fn a_curve_is_the_least_sum_at_each_rate() {
    for frontier in [frontier(0.1), crate::testing::frontier(3.0), Frontier::default()] {
        let (curve, heavy) = (Curve::of(&frontier, 1.0), Curve::of(&frontier, 10.0));
        for place in 0..RATES {
            let least = frontier.least_sum(GRID[place]).map(|point| point.cost);
            let least = least.unwrap_or(CostPoint::new(0.0, 0.0));
            assert_eq!(curve.at(place as f64), least);
            let later = (place + PER_DECADE as usize).min(RATES - 1);
            if later < RATES - 1 {
                assert!(
                    (heavy.at(place as f64).power.0 - curve.at(later as f64).power.0).abs() < 0.2
                );
            }
        }
    }
}

#[test]
fn dear_views_are_paid_for_by_cheap_ones_within_every_window() {
    for (limit, each) in [(3.0, 2), (4.0, 3), (5.0, 5), (6.0, 1)] {
        let mut tracker = RateTracker::default();
        let costs = play(&mut tracker, turns(240, each), (Some(limit), None, 30.0));
        let (power, error) = (mean(&costs, |c| c.power.0), mean(&costs, |c| c.error));
        assert!((0.95..1.014).contains(&(power / limit)), "{limit} W, {each} s: {power}");
        let worst = worst_window(&costs, |c| c.power.0);
        assert!(worst <= 1.02 * limit, "{limit} W, {each} s: {worst}");
        // Of the same power in every frame, and the optimum: powers in proportion to the root of errors'
        // scales (Lagrange), which the best settings bound.
        let same = 0.21 * (1.0 / limit - 0.1);
        let [easy, hard] = [0.02_f64, 0.4].map(f64::sqrt);
        let root = (easy + hard).powi(2) / 2.0;
        let optimum = (root / (2.0 * limit) - 0.021).max(0.0);
        assert!(error < same - 0.6 * (same - optimum), "{limit} W: {error}, {same}, {optimum}");
    }
}

#[test]
fn a_mean_error_costs_the_least_power() {
    for limit in [0.01, 0.03, 0.06] {
        let mut tracker = RateTracker::default();
        let costs = play(&mut tracker, turns(240, 3), (None, Some(limit), 30.0));
        let (power, error) = (mean(&costs, |c| c.power.0), mean(&costs, |c| c.error));
        assert!((0.9..1.005).contains(&(error / limit)), "{limit}: {error}");
        assert!(worst_window(&costs, |c| c.error) <= 1.02 * limit);
        let [easy, hard] = [0.02_f64, 0.4].map(f64::sqrt);
        let optimum = (easy + hard).powi(2) / 4.0 / (limit + 0.021);
        assert!(power < 1.1 * optimum.max(1.0), "{limit}: {power} W, {optimum} W");
    }
}

#[test]
fn with_two_limits_the_power_s_comes_first() {
    let with = |limits| {
        let mut tracker = RateTracker::default();
        let costs = play(&mut tracker, turns(120, 3), limits);
        (mean(&costs, |c| c.power.0), mean(&costs, |c| c.error))
    };
    let (power, error) = with((Some(3.0), Some(0.025), 30.0));
    let (alone, _) = with((None, Some(0.025), 30.0));
    assert!(
        alone > 3.1 && (2.85..3.04).contains(&power) && error > 0.03,
        "{power} {error} {alone}"
    );
    let (power, error) = with((Some(9.0), Some(0.06), 30.0));
    assert!(power < 4.0 && (0.05..0.0605).contains(&error), "{power} {error}");
}

#[test]
fn another_budget_begins_anew_and_a_drifting_one_does_not() {
    let mut tracker = RateTracker::default();
    assert!(tracker.begin(Some(3.0), None, 30.0));
    assert!(!tracker.begin(Some(3.1), None, 30.0), "three percent");
    assert!(!tracker.begin(Some(3.0), None, 30.0));
    for (power, error, horizon) in [
        (Some(4.0), None, 30.0),
        (None, None, 30.0),
        (Some(4.0), Some(0.1), 30.0),
        (Some(4.0), Some(0.2), 30.0),
        (Some(4.0), Some(0.2), 10.0),
        (Some(f64::INFINITY), Some(0.2), 10.0),
        (Some(4.0), Some(f64::INFINITY), 10.0),
        (Some(4.0), Some(0.2), 10.0),
    ] {
        assert!(tracker.begin(power, error, horizon), "{power:?} {error:?} {horizon}");
        assert!(!tracker.begin(power, error, horizon), "{power:?} {error:?} {horizon}");
    }
    // What was spent beyond an old budget is not held against a new one.
    let costs = play(&mut tracker, turns(60, 3), (Some(9.0), None, 30.0));
    assert!(mean(&costs, |c| c.power.0) > 8.0);
    let costs = play(&mut tracker, turns(60, 3), (Some(3.0), None, 30.0));
    assert!((2.8..3.1).contains(&mean(&costs, |c| c.power.0)));
}

#[test]
fn a_limit_that_could_not_be_kept_for_long_is_repaid_for_a_horizon_at_most() {
    let limits = (Some(3.0), None, 30.0);
    let mut tracker = RateTracker::default();
    play(&mut tracker, turns(60, 3), limits);
    // Ten minutes at 5 W too much, whatever the rate says.
    for view in turns(600, 3) {
        tracker.begin(limits.0, limits.1, limits.2);
        tracker.rate(&Curve::of(&view, 1.0), limits.0, limits.1, 1.0, 0.125);
        tracker.spend(CostPoint::new(8.0, 0.0), 0.125);
    }
    let costs = play(&mut tracker, turns(120, 3), limits);
    let means: Vec<f64> = costs.chunks(240).map(|part| mean(part, |c| c.power.0)).collect();
    assert!(means[0] < 2.0, "of 30 s each: {means:?}");
    assert!(means[2..].iter().all(|mean| (2.7..3.05).contains(mean)), "of 30 s each: {means:?}");
}

#[test]
fn limits_at_their_extremes_take_the_ends() {
    let with = |power, error| {
        let mut tracker = RateTracker::default();
        let costs = play(&mut tracker, turns(40, 3), (power, error, 30.0));
        mean(&costs, |c| c.power.0)
    };
    assert!((with(Some(0.0), None) - 1.0).abs() < 1e-9, "no settings cost 0 W");
    let (best, cheapest) = (with(None, None), with(None, Some(f64::INFINITY)));
    assert!((best - 10.0).abs() < 1e-9 && (cheapest - 1.0).abs() < 1e-9, "{best} {cheapest}");
    assert_eq!(with(Some(f64::INFINITY), None), best);
    assert!(with(None, Some(0.0)) > 9.99);
}

proptest! {
    #[test]
    fn no_numbers_break_it(
        numbers in prop::collection::vec(prop::num::f64::ANY, 6),
        frames in prop::collection::vec(prop::num::f64::ANY, 1..20),
    ) {
        let mut tracker = RateTracker::default();
        let (power, error) = (Some(numbers[0]), Some(numbers[1]));
        for seconds in frames.into_iter().chain([0.1, 1e300, 0.0]) {
            tracker.begin(power, error, numbers[2]);
            tracker.spend(CostPoint::new(numbers[3], numbers[4]), seconds);
            let rate = tracker.rate(&Curve::of(&frontier(0.1), 1.0), power, error, numbers[5], seconds);
            prop_assert!(rate.watts_per_error >= 0.0, "{:?}", rate);
        }
        // A sound budget afterwards is kept.
        let costs = play(&mut tracker, turns(60, 3), (Some(5.0), None, 30.0));
        let power = mean(&costs[240..], |c| c.power.0);
        prop_assert!((4.5..5.1).contains(&power), "{}", power);
    }
}

#[test]
fn an_empty_frontier_and_one_point_are_no_danger() {
    let mut tracker = RateTracker::default();
    tracker.begin(Some(3.0), None, 30.0);
    tracker.rate(&Curve::of(&Frontier::default(), 1.0), Some(3.0), None, 1.0, 0.1);
    let point = FrontierPoint { settings: KnobLevels::default(), cost: CostPoint::new(4.0, 0.1) };
    let one = Frontier::from_points([point]);
    let costs = play(&mut tracker, std::iter::repeat_n(one, 400), (Some(3.0), None, 30.0));
    assert!(costs.iter().all(|cost| cost.power == Watts(4.0)));
    assert_eq!(tracker.watts_per_error(), 0.0);
}

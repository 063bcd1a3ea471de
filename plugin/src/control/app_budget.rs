//! One power limit for all cameras, divided among them, and the levels that they share.

use bevy::log::warn_once;
use frugal_core::control::{Curve, RateTracker};
use smallvec::SmallVec;

use super::camera::Common;
use super::frame::{Agreement, Frame, same_space};
use super::{AppBudget, Budget, Limit, Outcome, PowerCorrection};
use crate::frontier::{CostPoint, FrontierPoint};
use crate::knobs::KnobLevels;
use crate::units::Watts;

impl AppBudget {
    /// The valid and finite limit.
    fn limit(&self) -> Option<Watts> {
        let limit = self.power.filter(|limit| limit.0 != f64::INFINITY)?;
        if limit.0 >= 0.0 {
            return Some(limit);
        }
        warn_once!("AppBudget of {} W is ignored: give a number of watts of 0 or more", limit.0);
        None
    }
}

/// Exchange rate that stands for an infinite one in sums.
const LARGE_RATE: f64 = 1e9;
/// Halvings of a range of rates.
const HALVINGS: usize = 40;

/// One exchange rate for all cameras, and what they may take together.
#[derive(Clone, Copy)]
struct Together {
    watts_per_error: f64,
    most: f64,
}

impl Common<'_> {
    /// Gives all cameras the exchange rate at which they keep the app's budget, each within its own, and
    /// agrees on the levels of the knobs that they share. Changes their choices. `rates` steers the rate of
    /// all cameras together.
    pub(super) fn divide(&self, rates: &mut RateTracker, frames: &mut [Frame<'_>]) {
        let app_limit = self.app_budget.limit();
        // Also without a limit: what is spent then counts under none.
        let watts = app_limit.map(|limit| limit.0);
        rates.begin(watts, None, Budget::HORIZON.as_secs_f64());
        // The cameras of the first one's knob space share levels, if there are several cameras.
        let wanted = if frames.len() > 1 { wanted(frames) } else { None };
        if frames.is_empty() || (app_limit.is_none() && wanted.is_none()) {
            return;
        }
        let total: f64 = frames.iter().map(|frame| frame.weight).sum();
        let mean = total / frames.len() as f64;
        for frame in &mut *frames {
            frame.weight = if mean > 0.0 { frame.weight / mean } else { 1.0 };
        }
        let together = match app_limit {
            Some(limit) => self.together(limit, rates, frames),
            None => Together { watts_per_error: f64::INFINITY, most: f64::INFINITY },
        };
        if let Some((first, Agreement { shared, levels })) = wanted {
            let space = std::sync::Arc::clone(&frames[first].space);
            let agreement = |frame: &Frame<'_>, levels| {
                let shares = same_space(&space, &frame.space);
                shares.then_some(Agreement { shared, levels })
            };
            let sum = |chosen: &[Point], is_kept: bool| {
                let cost = |(frame, (_, cost)): (&Frame<'_>, &Point)| {
                    let missed = f64::from(u8::from(cost.power.0 > frame.most.0 * (1.0 + 1e-9)));
                    let rate = rate_of(frame, together.watts_per_error);
                    missed * MISSED + cost.power.0 + rate * cost.error
                };
                let missed = if is_kept { 0.0 } else { MISSED };
                missed + frames.iter().zip(chosen).map(cost).sum::<f64>()
            };
            let alone: SmallVec<[Point; 4]> =
                frames.iter().map(|frame| (frame.choice.settings, frame.choice.cost)).collect();
            let levels = shared.agree(levels, frames.len(), sum(&alone, true), |levels| {
                let agreed = |frame: &Frame<'_>| agreement(frame, levels);
                let (chosen, is_kept, _) = choose_together(frames, together, &agreed)?;
                Some(sum(&chosen, is_kept))
            });
            for frame in &mut *frames {
                frame.agreed = agreement(frame, levels);
            }
        }
        let Some((chosen, is_kept, left)) =
            choose_together(frames, together, &|frame: &Frame<'_>| frame.agreed)
        else {
            return;
        };
        let correction = self.feedback.per_camera();
        for (frame, chosen) in frames.iter_mut().zip(chosen) {
            // What is left may be held where views move, and shared knobs allow it.
            let may_hold = frame.has_moved && frame.agreed.is_none();
            let most = Watts(chosen.1.power.0 + if may_hold { left } else { 0.0 });
            frame.choice.most.power = least(frame.choice.most.power, most);
            if frame.has_moved && app_limit.is_some() {
                frame.choice.watts_per_error = rate_of(frame, together.watts_per_error);
            }
            take(frame, chosen, app_limit.is_some(), is_kept, correction);
        }
    }

    /// The rate for the app's `limit`.
    fn together(&self, limit: Watts, rates: &mut RateTracker, frames: &[Frame<'_>]) -> Together {
        // Every frontier includes the device's idle power; a meter's offset takes that into account.
        let is_metered = self.feedback.correction != PowerCorrection::default();
        let counted_again = if is_metered { 0.0 } else { frames.len() as f64 - 1.0 };
        let idle = frames.last().and_then(|frame| frame.given.store.conditions()).map(|it| it.idle);
        let stored = self.feedback.mean_correction.uncorrected(limit)
            + idle.unwrap_or(Watts(0.0)) * counted_again;
        let mut sum = Curve::default();
        for frame in frames {
            sum.add(&Curve::of(frame.frontier(), frame.weight));
        }
        let hold = self.settings.hold_seconds();
        let rate = rates.rate(&sum, Some(stored.0), None, hold, self.time.delta_secs_f64());
        // In still views what could stay, as for a camera's own budget.
        if frames.iter().any(|frame| frame.has_moved) {
            Together { watts_per_error: rate.watts_per_error, most: rate.most.power.0 }
        } else {
            Together { watts_per_error: f64::INFINITY, most: stored.0 }
        }
    }
}

fn least(a: Watts, b: Watts) -> Watts {
    if b < a { b } else { a }
}

/// Settings with their cost, that of shared knobs included.
type Point = (KnobLevels, CostPoint);

/// What a missed limit counts in a sum of costs.
const MISSED: f64 = 1e15;

/// A camera's exchange rate: the lower one of its own budget's and of all cameras together.
fn rate_of(frame: &Frame<'_>, together: f64) -> f64 {
    // In a still view its own choice is a bound, and errors below it count alone.
    let own = if frame.has_moved { frame.choice.watts_per_error } else { f64::INFINITY };
    own.min(together.min(LARGE_RATE) * frame.weight)
}

/// The settings of a camera's frontier that it may take: none dearer than its own choice, before shared
/// knobs. None where all settings ask for more of a shared knob than is agreed on.
fn allowed<'a>(
    frame: &'a Frame<'_>,
    agreed: Option<Agreement<'a>>,
) -> impl Iterator<Item = Point> + Clone + 'a {
    let charged = move |point: &FrontierPoint| {
        let (settings, CostPoint { power, error }) = (point.settings, point.cost);
        let power = match agreed {
            Some(agreed) if agreed.shared.exceeds(settings, agreed.levels) => return None,
            Some(agreed) => power + agreed.charge(settings),
            None => power,
        };
        Some((settings, CostPoint { power, error }))
    };
    let most = frame.choice.cost.power;
    let points = frame.frontier().points().iter().take_while(move |point| point.cost.power <= most);
    points.filter_map(charged)
}

/// The best of the settings that a camera may take within its own budget, at an exchange rate; the
/// cheapest where none is.
fn best(frame: &Frame<'_>, agreed: Option<Agreement<'_>>, rate: f64) -> Option<Point> {
    let sum = |cost: CostPoint| cost.power.0 + rate * cost.error;
    let points = allowed(frame, agreed);
    let most = frame.most.0 * (1.0 + 1e-9);
    let within = points.clone().filter(|(_, cost)| cost.power.0 <= most);
    let best = within.min_by(|a, b| sum(a.1).total_cmp(&sum(b.1)));
    best.or_else(|| points.min_by(|a, b| a.1.power.0.total_cmp(&b.1.power.0)))
}

/// The choices of all cameras, whether they keep what they may take together, and the watts that they
/// leave. `None` where a camera has no settings at what is `agreed` on.
fn choose_together<'a>(
    frames: &[Frame<'a>],
    together: Together,
    agreed: &dyn Fn(&Frame<'a>) -> Option<Agreement<'a>>,
) -> Option<(SmallVec<[Point; 4]>, bool, f64)> {
    let at = |rate: f64| -> Option<SmallVec<[Point; 4]>> {
        frames.iter().map(|frame| best(frame, agreed(frame), rate_of(frame, rate))).collect()
    };
    let sum = |chosen: &[Point]| chosen.iter().map(|(_, cost)| cost.power.0).sum::<f64>();
    let keeps = |chosen: &[Point]| sum(chosen) <= together.most * (1.0 + 1e-9);
    let mut chosen = at(together.watts_per_error)?;
    if !keeps(&chosen) {
        chosen = at(0.0)?;
        let (mut low, mut high) = (1e-4_f64.ln(), together.watts_per_error.min(LARGE_RATE).ln());
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let here = at(middle.exp())?;
            if keeps(&here) { (low, chosen) = (middle, here) } else { high = middle }
        }
        raise(frames, &mut chosen, together.most, agreed);
    }
    let (left, is_kept) = ((together.most - sum(&chosen)).max(0.0), keeps(&chosen));
    Some((chosen, is_kept, left))
}

/// Spends what one rate leaves, by error for a watt: a better point of a camera each time.
fn raise<'a>(
    frames: &[Frame<'a>],
    chosen: &mut [Point],
    most: f64,
    agreed: &dyn Fn(&Frame<'a>) -> Option<Agreement<'a>>,
) {
    for _ in 0..64 * frames.len() {
        let sum: f64 = chosen.iter().map(|(_, cost)| cost.power.0).sum();
        let mut best: Option<(f64, usize, Point)> = None;
        for (number, frame) in frames.iter().enumerate() {
            let now = chosen[number].1;
            for (settings, cost) in allowed(frame, agreed(frame)) {
                let (more, less) = (cost.power.0 - now.power.0, now.error - cost.error);
                let fits = sum + more <= most && cost.power <= frame.most;
                let gain = frame.weight * less / more.max(1e-9);
                if fits && less > 0.0 && best.is_none_or(|(most, ..)| gain > most) {
                    best = Some((gain, number, (settings, cost)));
                }
            }
        }
        let Some((_, number, point)) = best else { return };
        chosen[number] = point;
    }
}

/// The highest level of each shared knob that a camera asks for, with the number of the first camera
/// that shares knobs. `None` where none does.
fn wanted<'a>(frames: &[Frame<'a>]) -> Option<(usize, Agreement<'a>)> {
    let first = frames.iter().position(|frame| frame.given.store.shared_levels().is_some())?;
    let shared = frames[first].given.store.shared_levels()?;
    let same = frames.iter().filter(|frame| same_space(&frames[first].space, &frame.space));
    let levels = same
        .fold(KnobLevels::default(), |levels, frame| shared.highest(levels, frame.choice.settings));
    Some((first, Agreement { shared, levels }))
}

/// Makes what was divided to a camera its choice; shared knobs are in its cost.
fn take(
    frame: &mut Frame<'_>,
    (settings, cost): Point,
    has_app_limit: bool,
    is_kept: bool,
    correction: PowerCorrection,
) {
    let (choice, limits) = (&mut frame.choice, &mut frame.limits);
    let is_other = settings != choice.settings;
    if has_app_limit && (is_other || !is_kept) {
        choice.binding = Some(Limit::AppBudget);
    }
    let is_own_kept = cost.power.0 <= frame.most.0 * (1.0 + 1e-9);
    (choice.settings, choice.cost) = (settings, cost);
    let misses_error = limits.error.is_some_and(|limit| is_other && cost.error > limit);
    choice.outcome = match choice.outcome {
        _ if !is_kept || !is_own_kept => Outcome::PowerCannotBeMet,
        Outcome::Met if misses_error => Outcome::LimitedByPower,
        outcome => outcome,
    };
    if has_app_limit {
        let part = correction.corrected(cost.power);
        limits.power = Some(limits.power.map_or(part, |limit| least(limit, part)));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use frugal_core::control::Limits;
    use frugal_core::testing;

    use super::*;
    use crate::control::{ControlSettings, ErrorFeedback, Inputs, select};
    use crate::frontier::{Frontier, FrontierStore, SampleRef};

    /// Numbers from 0 to 1, the same in every run (xorshift, Marsaglia 2003).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// Frontiers of up to `points` settings whose errors fall as powers rise.
    fn frontier(random: &mut Random, points: u32) -> Frontier {
        let (scale, bend) = (0.02 + 0.2 * random.next(), 1.0 + 2.0 * random.next());
        Frontier::from_points((0..points).map(|number| {
            let power = 1.0 + 5.0 * random.next();
            let error = scale * (power.powf(-bend) * (0.8 + 0.4 * random.next()));
            let settings = KnobLevels::from_bits(u128::from(number));
            FrontierPoint { settings, cost: CostPoint::new(power, error) }
        }))
    }

    /// The least sum of errors within `most`, by trying all.
    fn brute(frontiers: &[Frontier], most: f64) -> f64 {
        let Some((first, rest)) = frontiers.split_first() else { return 0.0 };
        let of = |point: &FrontierPoint| {
            let left = most - point.cost.power.0;
            let least: f64 = rest.iter().map(|other| other.points()[0].cost.power.0).sum();
            if left < least { f64::INFINITY } else { point.cost.error + brute(rest, left) }
        };
        first.points().iter().map(of).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn one_rate_is_near_the_best_division() {
        let (map, mut random) = (testing::map(0), Random(0x9e37_79b9_7f4a_7c15));
        let found = map.look_up(&testing::view()).expect("a frontier");
        let given = Inputs {
            store: &map,
            view: testing::view(),
            budget: Budget::default(),
            current: None,
            correction: PowerCorrection::default(),
            mean_correction: PowerCorrection::default(),
            errors: ErrorFeedback::default(),
            settings: ControlSettings::default(),
            delta_seconds: 0.0,
        };
        for (cameras, points, sets, most_above) in
            [(2, 12, 300, 0.06), (3, 12, 300, 0.05), (8, 5, 20, 0.03)]
        {
            let (mut mean, mut count) = (0.0, 0.0);
            for _ in 0..sets {
                let frontiers: Vec<Frontier> =
                    (0..cameras).map(|_| frontier(&mut random, points)).collect();
                let frames: Vec<Frame<'_>> = frontiers
                    .iter()
                    .map(|frontier| Frame {
                        weight: 1.0,
                        has_moved: false,
                        given,
                        limits: Limits::default(),
                        space: Arc::new(map.knobs.clone()),
                        found: SampleRef { frontier, ..found },
                        bounded: None,
                        choice: select(frontier, &Budget::default()).expect("the best"),
                        most: Watts(f64::INFINITY),
                        agreed: None,
                    })
                    .collect();
                let ends = |end: fn(&Frontier) -> f64| frontiers.iter().map(end).sum::<f64>();
                let low = ends(|it| it.points()[0].cost.power.0);
                let high = ends(|it| it.points()[it.points().len() - 1].cost.power.0);
                let most = low + (high - low) * (0.1 + 0.8 * random.next());
                let together = Together { watts_per_error: f64::INFINITY, most };
                let (chosen, is_kept, left) =
                    choose_together(&frames, together, &|_| None).expect("settings");
                let sum: f64 = chosen.iter().map(|(_, cost)| cost.power.0).sum();
                assert!(
                    is_kept && sum <= most * (1.0 + 1e-9) && (left - (most - sum)).abs() < 1e-9
                );
                let error: f64 = chosen.iter().map(|(_, cost)| cost.error).sum();
                let best = brute(&frontiers, most);
                assert!(error >= best * (1.0 - 1e-9), "{error} below the least, {best}");
                (mean, count) = (mean + error / best - 1.0, count + 1.0);
            }
            mean /= count;
            println!("    {cameras} cameras: {:.2} % above brute force in the mean", 100.0 * mean);
            assert!(mean <= most_above, "{cameras} cameras: {mean}");
        }
    }
}

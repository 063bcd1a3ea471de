//! The reactive ladder that engines ship: constant settings, stepped by meter readings.

use frugal_core::frontier::{CostPoint, Frontier};
use frugal_core::knobs::KnobLevels;

use crate::evaluate::{Choice, Policy, Pose, ResolvedBudget};

/// Rungs of the ladder.
const RUNGS: usize = 8;
/// Seconds over which the meter is averaged before a step down.
const WINDOW_SECONDS: f64 = 0.5;
/// Load below which a step up is allowed, as a share of the budget.
const ROOM: f64 = 0.85;
/// Seconds over which the load must stay below [`ROOM`].
const ROOM_SECONDS: f64 = 1.0;
/// Least seconds between two steps.
const DWELL_SECONDS: f64 = 0.5;

/// Up to eight non-dominated settings, evenly spread over the logarithm of power, the cheapest
/// first.
pub fn ladder(frontier: &Frontier) -> Vec<KnobLevels> {
    let points = frontier.points();
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let (low, high) = (first.cost.power.0.max(1e-9).ln(), last.cost.power.0.max(1e-9).ln());
    let rung = |rung: usize| {
        let wanted = low + (high - low) * rung as f64 / (RUNGS - 1) as f64;
        let far = |power: f64| (power.max(1e-9).ln() - wanted).abs();
        let points = points.iter();
        points.min_by(|a, b| far(a.cost.power.0).total_cmp(&far(b.cost.power.0)))
    };
    let mut rungs: Vec<_> = (0..RUNGS).filter_map(rung).map(|point| point.settings).collect();
    rungs.dedup();
    rungs
}

/// Steps down the ladder when the mean load of half a second exceeds the budget, and up when that
/// of a second is below 85 % of it.
///
/// Under an error budget it measures the error itself, which no app can: a generous baseline.
#[derive(Clone, Debug)]
pub struct Reactive {
    ladder: Vec<KnobLevels>,
    rung: usize,
    budget: ResolvedBudget,
    dt: f64,
    /// Load of each frame since the last step: cost as a share of the budget.
    loads: Vec<f64>,
}

impl Reactive {
    /// A policy that starts at the top rung. `ladder`: the cheapest settings first.
    pub fn new(ladder: Vec<KnobLevels>, budget: ResolvedBudget) -> Self {
        Self { rung: ladder.len().saturating_sub(1), ladder, budget, dt: 0.0, loads: Vec::new() }
    }

    /// Mean load of the last `seconds`; `None` sooner than that after the last step.
    fn load(&self, seconds: f64) -> Option<f64> {
        let frames = ((seconds / self.dt).round() as usize).max(1);
        let from = self.loads.len().checked_sub(frames)?;
        Some(self.loads[from..].iter().sum::<f64>() / frames as f64)
    }
}

impl Policy for Reactive {
    fn decide(&mut self, _: usize, dt: f64, _: &Pose) -> Choice {
        self.dt = dt;
        let dwelt = self.loads.len() as f64 * dt >= DWELL_SECONDS;
        let is_over = dwelt && self.load(WINDOW_SECONDS).is_some_and(|load| load > 1.0);
        let has_room = self.load(ROOM_SECONDS).is_some_and(|load| load < ROOM);
        // Exceeding a power budget steps down; exceeding an error budget steps up.
        let step = if is_over { -1 } else { isize::from(has_room) };
        let step = if self.budget.power_w.is_some() { step } else { -step };
        let rung = self.rung.saturating_add_signed(step);
        if rung != self.rung && rung < self.ladder.len() {
            self.rung = rung;
            self.loads.clear();
        }
        self.ladder.get(self.rung).copied().unwrap_or_default().into()
    }

    fn observe(&mut self, cost: CostPoint) {
        let load = match (self.budget.power_w, self.budget.error) {
            (Some(limit), _) => cost.power.0 / limit.0,
            (None, Some(limit)) => cost.error / limit,
            (None, None) => ROOM,
        };
        self.loads.push(load);
    }
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::FrontierPoint;
    use frugal_core::units::Watts;

    use super::*;
    use crate::testing::formula::path;

    fn frontier() -> Frontier {
        Frontier::from_points((0..20u128).map(|bits| FrontierPoint {
            settings: KnobLevels::from_bits(bits),
            cost: CostPoint::new(1.3f64.powi(bits as i32), 0.5 / (bits + 1) as f64),
        }))
    }

    #[test]
    fn the_ladder_spans_the_frontier() {
        let rungs = ladder(&frontier());
        assert_eq!((rungs.len(), rungs[0].bits(), rungs[7].bits()), (8, 0, 19));
        assert!(rungs.windows(2).all(|two| two[0] < two[1]));
        assert!(ladder(&Frontier::default()).is_empty());
    }

    fn converged(budget: ResolvedBudget) -> (u128, usize) {
        let (mut policy, pose) = (Reactive::new(ladder(&frontier()), budget), path().poses()[0]);
        let mut last = None;
        let mut switches = 0;
        for frame in 0..600 {
            let settings = policy.decide(frame, 1.0 / 30.0, &pose).settings;
            switches += usize::from(last.is_some_and(|last| last != settings));
            last = Some(settings);
            let level = settings.bits();
            policy.observe(CostPoint::new(1.3f64.powi(level as i32), 0.5 / (level + 1) as f64));
        }
        (last.map_or(0, KnobLevels::bits), switches)
    }

    #[test]
    fn it_finds_a_rung_within_the_budget() {
        let (rung, switches) =
            converged(ResolvedBudget { power_w: Some(Watts(30.0)), ..Default::default() });
        // Where one rung exceeds the budget and the next one down leaves room, the ladder
        // oscillates with a period of a second and a half.
        assert!(1.3f64.powi(rung as i32) <= 30.0 && switches < 30, "{rung}, {switches} switches");
        let (rung, _) = converged(ResolvedBudget { error: Some(0.1), ..Default::default() });
        // Within the budget, or returning to it.
        assert!(0.5 / (rung + 1) as f64 <= 0.13, "{rung}");
        assert_eq!(
            converged(ResolvedBudget { power_w: Some(Watts(0.1)), ..Default::default() }).0,
            0,
            "no lower than the cheapest"
        );
    }

    #[test]
    fn an_empty_ladder_is_harmless() {
        let mut policy = Reactive::new(Vec::new(), ResolvedBudget::default());
        for frame in 0..100 {
            policy.observe(CostPoint::new(f64::NAN, f64::NAN));
            assert_eq!(
                policy.decide(frame, 0.1, &path().poses()[0]).settings,
                KnobLevels::default()
            );
        }
    }
}

//! Two constants that take turns: a point of the lower hull of constants.

use frugal_core::frontier::{CostPoint, Frontier, FrontierPoint};
use frugal_core::knobs::KnobLevels;

use crate::evaluate::{Choice, Policy, Pose, ResolvedBudget};
use crate::table::CostTable;

/// Seconds between two changes.
const TURN_SECONDS: f64 = 1.0;

/// Two settings, and the share of the time that belongs to the second.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::evaluate) struct Mixed {
    settings: [KnobLevels; 2],
    share: f64,
    /// Seconds of the present turn, and how far the second's share is behind.
    seconds: f64,
    behind: f64,
    is_second: bool,
}

impl Policy for Mixed {
    fn decide(&mut self, _: usize, dt: f64, _: &Pose) -> Choice {
        if self.seconds <= 0.0 {
            self.is_second = self.behind + self.share * TURN_SECONDS >= 0.5 * TURN_SECONDS;
            self.seconds = TURN_SECONDS;
        }
        self.seconds -= dt;
        self.behind += dt * (self.share - f64::from(self.is_second));
        self.settings[usize::from(self.is_second)].into()
    }
}

/// The two constants between which a mean over a path meets `budget` with the least error, or the least
/// power; the nearest one where none does. `None` for a table without a complete column.
pub(in crate::evaluate) fn mixed_constants(
    table: &CostTable,
    budget: &ResolvedBudget,
) -> Option<Mixed> {
    let points = table.means().map(|(settings, cost)| FrontierPoint { settings, cost });
    let frontier = Frontier::from_points(points);
    let points = frontier.points();
    let (first, last) = (points.first()?, points.last()?);
    let alone = |point: &FrontierPoint| mix([point.settings; 2], 0.0);
    // Costs fall or rise along the frontier, and the limit lies between two points.
    let (value, other, limit): (fn(CostPoint) -> f64, fn(CostPoint) -> f64, f64) =
        match (budget.power_w, budget.error) {
            (Some(limit), _) => (|cost| cost.power.0, |cost| cost.error, limit.0),
            (None, Some(limit)) => (|cost| cost.error, |cost| cost.power.0, limit),
            (None, None) => return Some(alone(last)),
        };
    let (within, beyond): (Vec<&FrontierPoint>, Vec<&FrontierPoint>) =
        points.iter().partition(|p| value(p.cost) <= limit);
    let Some(nearest) = within.iter().min_by(|a, b| other(a.cost).total_cmp(&other(b.cost))) else {
        return Some(alone(if budget.power_w.is_some() { first } else { last }));
    };
    let mut best = (other(nearest.cost), alone(nearest));
    for a in &within {
        for b in &beyond {
            let share = (limit - value(a.cost)) / (value(b.cost) - value(a.cost));
            let mean = other(a.cost) + share * (other(b.cost) - other(a.cost));
            if mean < best.0 {
                best = (mean, mix([a.settings, b.settings], share));
            }
        }
    }
    Some(best.1)
}

fn mix(settings: [KnobLevels; 2], share: f64) -> Mixed {
    Mixed { settings, share, seconds: 0.0, behind: 0.0, is_second: false }
}

#[cfg(test)]
mod tests {
    use frugal_core::units::Watts;

    use super::*;
    use crate::testing::formula::path;

    #[test]
    fn constants_take_turns_on_the_lower_hull() {
        let mut table = CostTable::new(1);
        // The second is above the line from the first to the third.
        for (bits, (power, error)) in [(1.0, 0.3), (2.0, 0.25), (3.0, 0.1)].into_iter().enumerate()
        {
            table.set(0, KnobLevels::from_bits(bits as u128), CostPoint::new(power, error));
        }
        let budget = |power: Option<f64>, error| ResolvedBudget {
            power_w: power.map(Watts),
            error,
            ..Default::default()
        };
        let played = |budget: &ResolvedBudget| {
            let mut mixed = mixed_constants(&table, budget).expect("constants");
            let mut shares = [0.0; 3];
            for frame in 0..1000 {
                let choice = mixed.decide(frame, 0.1, &path().poses()[0]);
                shares[choice.settings.bits() as usize] += 1e-3;
            }
            shares.map(|share: f64| (share * 50.0).round() / 50.0)
        };
        assert_eq!(played(&budget(Some(2.5), None)), [0.26, 0.0, 0.74]);
        assert_eq!(played(&budget(None, Some(0.2))), [0.5, 0.0, 0.5]);
        assert_eq!(played(&budget(Some(9.0), None)), [0.0, 0.0, 1.0]);
        assert_eq!(played(&budget(Some(0.5), None)), [1.0, 0.0, 0.0], "none is within it");
        assert_eq!(played(&budget(None, Some(0.01))), [0.0, 0.0, 1.0]);
        assert_eq!(mixed_constants(&CostTable::new(1), &budget(None, None)), None);
    }
}

//! Baselines, simulated from a [`PathRecord`](super::PathRecord): constants, oracles, and the
//! reactive ladder that engines ship.
//!
//! | run | information used |
//! |---|---|
//! | `best-constant` | this path: the best constant settings for the budget |
//! | `mixed-constants` | this path: the two constants that take turns best |
//! | `trained-constant` | other cameras: the best constant settings there |
//! | `shared-frontier` | other cameras: one frontier for all views, under the plugin's controller |
//! | `oracle` | every frame in advance, one exchange rate, settings held for a second: a bound |
//! | `oracle-filtered` | the same, through the controller's temporal filter |
//! | `reactive` | meter readings of earlier frames |
//! | `default` | none: `FrugalGi::default()`, all other knobs at their best |

mod mixed;
mod oracle;
mod reactive;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;

use crate::evaluate::ResolvedBudget;

pub(super) use mixed::mixed_constants;
pub(super) use oracle::{Oracle, oracle};
pub use reactive::{Reactive, ladder};

/// The best settings for `budget` among candidates with their mean costs.
///
/// Under a power budget, the least mean error within it; under an error budget alone, the least
/// mean power within it. Where no settings meet it, the nearest. `None` without candidates.
pub(super) fn best_of(
    candidates: impl IntoIterator<Item = (KnobLevels, CostPoint)>,
    budget: &ResolvedBudget,
) -> Option<(KnobLevels, CostPoint)> {
    // Lexicographic: excess over the limit, then the objective.
    let rank = |cost: CostPoint| match (budget.power_w, budget.error) {
        (Some(power), _) => {
            let over = (cost.power.0 - power.0).max(0.0);
            [over, cost.error, cost.power.0]
        }
        (None, Some(error)) => [(cost.error - error).max(0.0), cost.power.0, cost.error],
        (None, None) => [0.0, cost.error, cost.power.0],
    };
    let compare = |a: [f64; 3], b: [f64; 3]| {
        a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne())
    };
    candidates
        .into_iter()
        .min_by(|a, b| compare(rank(a.1), rank(b.1)).unwrap_or(std::cmp::Ordering::Equal))
}

#[cfg(test)]
mod tests {
    use frugal_core::units::Watts;

    use super::*;
    use crate::table::CostTable;

    #[test]
    fn the_best_within_the_budget_or_the_nearest_to_it() {
        let mut table = CostTable::new(2);
        let costs = [(1.0, 0.3), (2.0, 0.1), (3.0, 0.15), (4.0, 0.0)];
        for (bits, (power, error)) in costs.into_iter().enumerate() {
            for row in 0..2 {
                // The means are the given costs: the two cameras deviate symmetrically.
                let sign = if row == 0 { 1.0 } else { -1.0 };
                table.set(
                    row,
                    KnobLevels::from_bits(bits as u128),
                    CostPoint::new(power + 0.1 * sign, error * (1.0 + 0.5 * sign)),
                );
            }
        }
        table.set(0, KnobLevels::from_bits(9), CostPoint::new(0.1, 0.0));
        let best = |power: Option<f64>, error| {
            let budget = ResolvedBudget { power_w: power.map(Watts), error, ..Default::default() };
            best_of(table.means(), &budget).map(|(settings, _)| settings.bits())
        };
        assert_eq!(
            best(Some(3.5), None),
            Some(1),
            "the third is dominated, the last is known at one camera only"
        );
        assert_eq!(best(Some(9.0), None), Some(3));
        assert_eq!(
            best(Some(0.5), None),
            Some(0),
            "the cheapest, where nothing is within the budget"
        );
        assert_eq!(best(None, Some(0.2)), Some(1));
        assert_eq!(best(None, Some(0.0)), Some(3));
        assert_eq!(best(None, None), Some(3));
        assert_eq!(best_of(CostTable::new(1).means(), &ResolvedBudget::default()), None);
    }
}

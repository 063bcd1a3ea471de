//! Upper bounds: policies that know every frame's costs in advance.

use crate::table::CostTable;
use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;

use crate::evaluate::{Choice, Policy, Pose, ResolvedBudget};

/// Range of exchange rates searched, watts per unit of error.
const RATES: (f64, f64) = (1e-3, 1e9);
/// Bisection steps in the logarithm of the rate: to a relative precision of 10⁻¹².
const HALVINGS: usize = 64;

/// Settings of each frame, chosen in advance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::evaluate) struct Oracle(pub Vec<KnobLevels>);

impl Policy for Oracle {
    fn decide(&mut self, frame: usize, _: f64, _: &Pose) -> Choice {
        self.0.get(frame).or(self.0.last()).copied().unwrap_or_default().into()
    }
}

/// The settings of each second of the path by one exchange rate: the least power + λ × error of its
/// frames' means (Everett 1963, "Generalized Lagrange multiplier method"), with the best rate that keeps
/// the mean over the path. `hold`: frames of a second. `is_met` tests whether settings for all frames keep
/// the budget, by the table alone or through a filter.
pub(in crate::evaluate) fn oracle(
    table: &CostTable,
    budget: &ResolvedBudget,
    hold: usize,
    is_met: &mut dyn FnMut(&Oracle) -> bool,
) -> Oracle {
    let at = |best: &dyn Fn(CostPoint) -> [f64; 2]| {
        let mut all = Vec::with_capacity(table.rows());
        for first in (0..table.rows()).step_by(hold.max(1)) {
            let rows = first..(first + hold.max(1)).min(table.rows());
            let known = table.settings().iter().enumerate().filter_map(|(column, settings)| {
                Some((best(table.mean(column, rows.clone())?), *settings))
            });
            let least =
                known.min_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])));
            let settings = least.map(|(_, settings)| settings).unwrap_or_default();
            all.extend(rows.map(|_| settings));
        }
        Oracle(all)
    };
    // Of equal sums the one that errs on the budget's side.
    let by_power = budget.power_w.is_some();
    let at_rate = |rate: f64| {
        at(&move |cost: CostPoint| {
            let tie = if by_power { cost.power.0 } else { cost.error };
            [cost.power.0 + rate * cost.error, tie]
        })
    };
    if budget.power_w.is_none() && budget.error.is_none() {
        return at(&|cost| [cost.error, cost.power.0]);
    }
    let (mut low, mut high) = (RATES.0.ln(), RATES.1.ln());
    for _ in 0..HALVINGS {
        let middle = low.midpoint(high);
        // More power at a greater rate, and less error.
        if is_met(&at_rate(middle.exp())) == by_power { low = middle } else { high = middle }
    }
    at_rate(if by_power { low } else { high }.exp())
}

#[cfg(test)]
mod tests {
    use frugal_core::units::Watts;

    use super::*;

    /// Two views: lowering the error costs ten times as much in the second.
    fn table() -> CostTable {
        let mut table = CostTable::new(2);
        for level in 0..=10u128 {
            let quality = level as f64 / 10.0;
            for (row, price) in [(0, 1.0), (1, 10.0)] {
                table.set(
                    row,
                    KnobLevels::from_bits(level),
                    CostPoint::new(1.0 + price * quality * quality, 0.1 * (1.0 - quality)),
                );
            }
        }
        table
    }

    fn mean(table: &CostTable, oracle: &Oracle) -> CostPoint {
        let costs: Vec<_> = oracle
            .0
            .iter()
            .enumerate()
            .filter_map(|(row, settings)| table.get(row, *settings))
            .collect();
        let count = costs.len() as f64;
        CostPoint::new(
            costs.iter().map(|c| c.power.0).sum::<f64>() / count,
            costs.iter().map(|c| c.error).sum::<f64>() / count,
        )
    }

    #[test]
    fn a_mean_error_is_bought_where_it_is_cheap() {
        let table = table();
        let budget = ResolvedBudget { error: Some(0.05), ..Default::default() };
        let best =
            oracle(&table, &budget, 1, &mut |oracle| mean(&table, oracle).error <= 0.05 + 1e-12);
        let cost = mean(&table, &best);
        assert!(cost.error <= 0.05 + 1e-12, "{cost:?}");
        assert!(best.0[0].bits() > 7 && best.0[1].bits() < 3, "{best:?}");
        // By exhaustive search: no pair of levels within the budget is cheaper by more than one
        // level's step.
        let pairs = (0..121).map(|pair| {
            Oracle(vec![KnobLevels::from_bits(pair / 11), KnobLevels::from_bits(pair % 11)])
        });
        let least = pairs
            .map(|pair| mean(&table, &pair))
            .filter(|c| c.error <= 0.05 + 1e-12)
            .map(|c| c.power.0)
            .fold(f64::MAX, f64::min);
        assert!(cost.power.0 <= least + 0.1, "{} against {least}", cost.power.0);
    }

    #[test]
    fn a_mean_power_is_spent_where_it_buys_most() {
        let table = table();
        let at = |watts: f64, hold: usize| {
            let budget = ResolvedBudget { power_w: Some(Watts(watts)), ..Default::default() };
            let best =
                oracle(&table, &budget, hold, &mut |oracle| mean(&table, oracle).power.0 <= watts);
            best.0.iter().map(|settings| settings.bits()).collect::<Vec<_>>()
        };
        let best = at(2.0, 1);
        assert!(best[0] > 7 && best[1] < 5, "{best:?}");
        let held = at(2.0, 2);
        assert_eq!((held[0], held.len()), (held[1], 2), "one for both");
        assert_eq!(at(0.5, 1), [0, 0], "the cheapest");
        assert_eq!(at(99.0, 1), [10, 10]);
        let empty = oracle(&CostTable::new(0), &ResolvedBudget::default(), 1, &mut |_| true);
        assert_eq!(empty, Oracle(vec![]));
    }
}

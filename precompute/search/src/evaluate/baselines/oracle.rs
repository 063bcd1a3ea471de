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
pub struct Oracle(pub Vec<KnobLevels>);

impl Policy for Oracle {
    fn decide(&mut self, frame: usize, _: f64, _: &Pose) -> Choice {
        self.0.get(frame).or(self.0.last()).copied().unwrap_or_default().into()
    }
}

/// The optimal settings of each frame.
///
/// Under a power budget each frame keeps it: the least error within it. Under an error budget the
/// mean over the path keeps it: each frame minimises P + λe, with the least λ that does (Everett
/// 1963, "Generalized Lagrange multiplier method"). `is_met` tests whether settings for all frames
/// keep the error budget, by the table alone or through a filter.
pub fn oracle(
    table: &CostTable,
    budget: &ResolvedBudget,
    is_met: &mut dyn FnMut(&Oracle) -> bool,
) -> Oracle {
    let frames = |best: &dyn Fn(CostPoint) -> [f64; 2]| {
        let settings = (0..table.rows()).map(|row| {
            let known = table
                .settings()
                .iter()
                .enumerate()
                .filter_map(|(column, settings)| Some((*settings, table.at(row, column)?)));
            let ranked = known.map(|(settings, cost)| (best(cost), settings));
            let least =
                ranked.min_by(|a, b| a.0[0].total_cmp(&b.0[0]).then(a.0[1].total_cmp(&b.0[1])));
            least.map(|(_, settings)| settings).unwrap_or_default()
        });
        Oracle(settings.collect())
    };
    match (budget.power_w, budget.error) {
        (Some(limit), _) => frames(&|cost| {
            let over = cost.power.0 - limit.0;
            // Where no settings are within the limit, the cheapest.
            if over > 0.0 { [f64::MAX, over] } else { [cost.error, cost.power.0] }
        }),
        (None, Some(_)) => {
            let at =
                |rate: f64| frames(&move |cost| [cost.power.0 + rate * cost.error, cost.error]);
            let (mut low, mut high) = (RATES.0.ln(), RATES.1.ln());
            for _ in 0..HALVINGS {
                let middle = low.midpoint(high);
                if is_met(&at(middle.exp())) { high = middle } else { low = middle }
            }
            at(high.exp())
        }
        (None, None) => frames(&|cost| [cost.error, cost.power.0]),
    }
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
        let budget = ResolvedBudget { power_w: None, error: Some(0.05) };
        let best =
            oracle(&table, &budget, &mut |oracle| mean(&table, oracle).error <= 0.05 + 1e-12);
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
    fn a_power_budget_is_kept_by_every_frame() {
        let table = table();
        let best =
            oracle(&table, &ResolvedBudget { power_w: Some(Watts(2.0)), error: None }, &mut |_| {
                true
            });
        assert_eq!(best.0.iter().map(|settings| settings.bits()).collect::<Vec<_>>(), [10, 3]);
        let none =
            oracle(&table, &ResolvedBudget { power_w: Some(Watts(0.5)), error: None }, &mut |_| {
                true
            });
        assert_eq!(
            none.0.iter().map(|settings| settings.bits()).collect::<Vec<_>>(),
            [0, 0],
            "the cheapest"
        );
        assert_eq!(
            oracle(&CostTable::new(0), &ResolvedBudget::default(), &mut |_| true),
            Oracle(vec![])
        );
    }
}

//! Selection of a portfolio of settings.

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;

use super::scores;
use crate::table::CostTable;

/// Least relative gain for which another setting is kept.
const LEAST_GAIN: f64 = 1e-5;

/// Losses of settings at one camera against the best of them: a row for each goal.
fn losses(costs: &[CostPoint]) -> Vec<Vec<f64>> {
    let power = || costs.iter().map(|cost| cost.power.0);
    let range = power().fold(f64::INFINITY, f64::min)..power().fold(0.0, f64::max);
    let scores: Vec<Vec<f64>> = costs.iter().map(|cost| scores(&range, cost).collect()).collect();
    let count = scores.first().map_or(0, Vec::len);
    let row = |goal: usize| {
        let at = scores.iter().map(|scores| scores[goal]);
        let least = at.clone().fold(f64::INFINITY, f64::min);
        at.map(|score| score - least).collect()
    };
    (0..count).map(row).collect()
}

/// At most `most` settings of `table` with the least loss against using all of them, those of
/// `always` first. Greedy: each reduces the remaining loss most. Settings that are not known at
/// every camera are left out.
pub(crate) fn portfolio(table: &CostTable, most: usize, always: &[KnobLevels]) -> Vec<KnobLevels> {
    let columns: Vec<usize> =
        (0..table.settings().len()).filter(|column| table.is_complete(*column)).collect();
    // Every camera's losses.
    let costs = |row: usize| -> Option<Vec<CostPoint>> {
        columns.iter().map(|column| table.at(row, *column)).collect()
    };
    let rows: Vec<Vec<f64>> = (0..table.rows())
        .filter_map(costs)
        .filter(|costs| costs.iter().all(|cost| cost.power.0 > 0.0))
        .flat_map(|costs| losses(&costs))
        .collect();
    let take = |left: &mut [f64], index: usize| {
        left.iter_mut().zip(&rows).for_each(|(left, row)| *left = left.min(row[index]));
    };
    let index_of = |settings: &KnobLevels| {
        columns.iter().position(|column| table.settings()[*column] == *settings)
    };
    let mut left: Vec<f64> = vec![f64::INFINITY; rows.len()];
    let mut kept: Vec<usize> = always.iter().filter_map(index_of).collect();
    kept.iter().for_each(|index| take(&mut left, *index));
    while kept.len() < most {
        // All losses are infinite at first: then the least total decides, later the greatest gain.
        let total = |index: usize| -> f64 {
            left.iter().zip(&rows).map(|(left, row)| left.min(row[index])).sum()
        };
        let now: f64 = left.iter().sum();
        let best = (0..columns.len())
            .filter(|index| !kept.contains(index))
            .min_by(|a, b| total(*a).total_cmp(&total(*b)));
        let Some(best) = best else { break };
        if now.is_finite() && now - total(best) <= LEAST_GAIN * rows.len() as f64 {
            break;
        }
        take(&mut left, best);
        kept.push(best);
    }
    kept.into_iter().map(|index| table.settings()[columns[index]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two kinds of cameras, each with its own good settings; even bits suit the first, odd ones
    /// the second.
    fn table() -> CostTable {
        let mut table = CostTable::new(6);
        for row in 0..6 {
            for bits in 0..40u128 {
                let quality = (bits / 2) as f64 / 19.0;
                let suits = bits % 2 == row as u128 % 2;
                let error = 0.2 * (1.0 - quality).powi(2) * if suits { 1.0 } else { 3.0 };
                table.set(
                    row,
                    KnobLevels::from_bits(bits),
                    CostPoint::new(1.0 + 9.0 * quality, error),
                );
            }
        }
        table
    }

    /// Power of the best of `kept` above that of the best of all, for error budgets: the mean logarithm
    /// over cameras and budgets.
    fn regret(table: &CostTable, kept: &[KnobLevels]) -> f64 {
        let mut ratios = Vec::new();
        for row in 0..table.rows() {
            for budget in [0.005, 0.01, 0.02, 0.03, 0.05, 0.1] {
                let least = |settings: &[KnobLevels]| {
                    let costs = settings.iter().filter_map(|settings| table.get(row, *settings));
                    let within = costs.filter(|cost| cost.error <= budget);
                    within.map(|cost| cost.power.0).fold(f64::INFINITY, f64::min)
                };
                ratios.push((least(kept) / least(table.settings())).ln());
            }
        }
        ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
    }

    #[test]
    fn both_kinds_of_cameras_are_served_and_more_settings_serve_better() {
        let table = table();
        let best = KnobLevels::from_bits(39);
        let mut last = f64::INFINITY;
        for most in [2, 6, 12, 20] {
            let kept = portfolio(&table, most, &[best]);
            assert!(kept.len() <= most && kept[0] == best);
            let lost = regret(&table, &kept);
            assert!(lost < last, "{most}: {lost} after {last}");
            last = lost;
        }
        assert!(last < 0.05, "{last}");
        let kept = portfolio(&table, 12, &[]);
        assert!(kept.iter().filter(|s| s.bits() % 2 == 0).count().abs_diff(6) <= 2, "{kept:?}");
        assert!(regret(&table, table.settings()) < 1e-12);
    }

    #[test]
    fn tables_without_rows_or_columns_are_no_panic() {
        assert!(portfolio(&CostTable::new(0), 5, &[]).is_empty());
        assert!(portfolio(&CostTable::new(3), 5, &[KnobLevels::default()]).is_empty());
        assert_eq!(regret(&CostTable::new(0), &[]), 0.0);
    }
}

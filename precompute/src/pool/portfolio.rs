//! Selection of a portfolio of settings.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;

use super::LEAST_ERROR;
use crate::table::CostTable;

/// Exchange rates of the losses, in units of the best settings' power per unit of error: those of
/// error budgets from a few hundredths to a few thousandths.
pub(super) const RATES: [f64; 8] = [4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];
/// Number of power budgets of the losses, evenly spread over the range of power.
pub(super) const BUDGETS: usize = 19;
/// The least power budget, as a share of the range: cheaper settings have errors that no app would
/// ship.
const LEAST_BUDGET: f64 = 0.1;
/// Weight of the error at a power budget relative to the cost at an exchange rate. Of 139 settings at
/// six views of a court, the best of each view among 32 chosen at 0.5 has at most 6 % more error at power
/// budgets of 20 to 90 % than the best of all; at 0.25 it has 4 and 2 % more than at 0.5 at two of them.
pub(super) const BUDGET_WEIGHT: f64 = 0.5;
/// Least relative gain for which another setting is kept.
const LEAST_GAIN: f64 = 1e-5;

/// The power budget of number `step` within a range of power.
pub(super) fn budget(range: (f64, f64), step: usize) -> f64 {
    let share = LEAST_BUDGET + (1.0 - LEAST_BUDGET) * step as f64 / (BUDGETS - 1) as f64;
    (range.0 + (range.1 - range.0) * share) * (1.0 + 1e-9)
}

/// Losses of settings at one camera: a number for each exchange rate and power budget, lower is
/// better.
fn losses(costs: &[CostPoint], best_power: f64, range: (f64, f64)) -> Vec<Vec<f64>> {
    let rates = RATES.iter().map(|rate| {
        let sum = |cost: &CostPoint| cost.power.0 / best_power + rate * cost.error;
        let least = costs.iter().map(sum).fold(f64::INFINITY, f64::min);
        costs.iter().map(|cost| sum(cost) / least - 1.0).collect()
    });
    let budgets = (0..BUDGETS).map(|step| {
        let limit = budget(range, step);
        let error = |cost: &CostPoint| {
            if cost.power.0 <= limit {
                (cost.error + LEAST_ERROR).ln()
            } else {
                LEAST_ERROR.ln() + 8.0
            }
        };
        let least = costs.iter().map(error).fold(f64::INFINITY, f64::min);
        costs.iter().map(|cost| BUDGET_WEIGHT * (error(cost) - least)).collect()
    });
    rates.chain(budgets).collect()
}

/// Every camera's losses, a row for each.
fn all_losses(table: &CostTable, columns: &[usize]) -> Vec<Vec<f64>> {
    let mut rows = Vec::new();
    for row in 0..table.rows() {
        let costs: Option<Vec<CostPoint>> =
            columns.iter().map(|column| table.at(row, *column)).collect();
        let Some(costs) = costs.filter(|costs| costs.iter().all(|cost| cost.power.0 > 0.0)) else {
            continue;
        };
        let power = |pick: fn(f64, f64) -> f64, start: f64| {
            costs.iter().map(|cost| cost.power.0).fold(start, pick)
        };
        let range = (power(f64::min, f64::INFINITY), power(f64::max, 0.0));
        rows.extend(losses(&costs, range.1, range));
    }
    rows
}

/// At most `most` settings of `table` with the least loss against using all of them, those of
/// `always` first. Greedy: each reduces the remaining loss most. Settings that are not known at
/// every camera are left out.
pub(crate) fn portfolio(table: &CostTable, most: usize, always: &[KnobLevels]) -> Vec<KnobLevels> {
    let columns: Vec<usize> =
        (0..table.settings().len()).filter(|column| table.is_complete(*column)).collect();
    let rows = all_losses(table, &columns);
    let mut left: Vec<f64> = vec![f64::INFINITY; rows.len()];
    let mut kept: Vec<usize> = Vec::new();
    let mut take = |index: usize, left: &mut Vec<f64>| {
        left.iter_mut().zip(&rows).for_each(|(left, row)| *left = left.min(row[index]));
        kept.push(index);
    };
    for settings in always {
        if let Some(index) =
            columns.iter().position(|column| table.settings()[*column] == *settings)
        {
            take(index, &mut left);
        }
    }
    let mut taken: Vec<bool> = (0..columns.len())
        .map(|index| always.contains(&table.settings()[columns[index]]))
        .collect();
    for _ in 0..most.saturating_sub(taken.iter().filter(|taken| **taken).count()) {
        // All losses are infinite at first: then the least total decides, later the greatest gain.
        let total = |index: usize| -> f64 {
            left.iter().zip(&rows).map(|(left, row)| left.min(row[index])).sum()
        };
        let now: f64 = left.iter().sum();
        let best = (0..columns.len())
            .filter(|index| !taken[*index])
            .min_by(|a, b| total(*a).total_cmp(&total(*b)));
        let Some(best) = best else { break };
        if now.is_finite() && now - total(best) <= LEAST_GAIN * rows.len() as f64 {
            break;
        }
        taken[best] = true;
        take(best, &mut left);
    }
    kept.into_iter().map(|index| table.settings()[columns[index]]).collect()
}

/// Loss of `kept` against all settings of `table`: mean over cameras, exchange rates and budgets.
#[cfg(test)]
fn regret(table: &CostTable, kept: &[KnobLevels]) -> f64 {
    let columns: Vec<usize> =
        (0..table.settings().len()).filter(|column| table.is_complete(*column)).collect();
    let indices: Vec<usize> = (0..columns.len())
        .filter(|index| kept.contains(&table.settings()[columns[*index]]))
        .collect();
    let rows = all_losses(table, &columns);
    let least =
        |row: &Vec<f64>| indices.iter().map(|index| row[*index]).fold(f64::INFINITY, f64::min);
    rows.iter().map(least).sum::<f64>() / rows.len().max(1) as f64
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

//! What tables and drawings have in common: paths, baselines, medians.

use crate::data::{Data, Played, PowerRow};

/// A policy to compare with.
pub(crate) struct Baseline {
    pub(crate) name: &'static str,
    pub(crate) of: fn(&PowerRow) -> Played,
}

/// What the controller is compared with under equal budgets. The first two are constants, which leave
/// what lies between them unused.
pub(crate) const BASELINES: [Baseline; 4] = [
    Baseline { name: "trained constant", of: |row| row.trained },
    Baseline { name: "best constant", of: |row| row.best },
    Baseline { name: "two constants in turns", of: |row| row.turns },
    Baseline { name: "one frontier for all views", of: |row| row.shared },
];

/// Budgets above this share of the range are those of the medians.
pub(crate) const FROM: f64 = 0.295;

/// Median and extremes.
#[derive(Clone, Copy)]
pub(crate) struct Spread {
    pub(crate) low: f64,
    pub(crate) median: f64,
    pub(crate) high: f64,
}

impl Spread {
    /// Of `values`, of which there is one at least.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let at = |place: usize| values.get(place).copied().unwrap_or(f64::NAN);
        let last = values.len().saturating_sub(1);
        Self { low: at(0), median: 0.5 * (at(last / 2) + at(last.div_ceil(2))), high: at(last) }
    }
}

/// Scene and path of each record, in the order of the file.
pub(crate) fn paths(data: &Data) -> Vec<(String, String)> {
    let mut paths: Vec<_> = data
        .policies
        .power_budgets
        .iter()
        .map(|row| (row.scene.clone(), row.path.clone()))
        .collect();
    paths.dedup();
    paths
}

/// The rows of a path that medians are of.
pub(crate) fn rows_of<'a>(
    data: &'a Data,
    (scene, path): &'a (String, String),
) -> impl Iterator<Item = &'a PowerRow> {
    data.policies
        .power_budgets
        .iter()
        .filter(move |row| row.scene == *scene && row.path == *path && row.budget > FROM)
}

/// The controller's error ÷ a baseline's, on a path.
pub(crate) fn baseline_ratios(data: &Data, path: &(String, String), baseline: &Baseline) -> Spread {
    Spread::of(rows_of(data, path).map(|row| row.frugal.error / (baseline.of)(row).error))
}

/// Share of the power budgets that a policy uses, on some paths.
pub(crate) fn used<'a>(
    data: &'a Data,
    paths: impl IntoIterator<Item = &'a (String, String)>,
    of: fn(&PowerRow) -> Played,
) -> Spread {
    let rows = paths.into_iter().flat_map(|path| rows_of(data, path));
    Spread::of(rows.map(|row| of(row).w / row.limit_w))
}

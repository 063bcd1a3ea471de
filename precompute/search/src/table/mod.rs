//! Costs of settings at cameras: the table that searches fill, frontiers are fitted to, and
//! policies are simulated from.
//!
//! A row is a camera, or a frame of a path; a column is a combination of settings. Independent of
//! the renderer.

use std::collections::HashMap;
use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_trace::scene::CameraPose;

/// Power and error by camera and settings. Settings that were not rendered are unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CostTable {
    rows: usize,
    settings: Vec<KnobLevels>,
    columns: HashMap<KnobLevels, usize>,
    /// By column, then by row; NaN where unknown.
    costs: Vec<Vec<CostPoint>>,
}

impl CostTable {
    const UNKNOWN: CostPoint = CostPoint::new(f64::NAN, f64::NAN);

    /// An empty table of `rows` cameras.
    pub fn new(rows: usize) -> Self {
        Self { rows, ..Self::default() }
    }

    /// Number of cameras.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// All settings with a known cost, in the order of insertion.
    pub fn settings(&self) -> &[KnobLevels] {
        &self.settings
    }

    /// Column of `settings`.
    pub fn column(&self, settings: KnobLevels) -> Option<usize> {
        self.columns.get(&settings).copied()
    }

    /// Sets the cost of `settings` at camera `row`. Rows beyond the table are ignored.
    pub fn set(&mut self, row: usize, settings: KnobLevels, cost: CostPoint) {
        let column = *self.columns.entry(settings).or_insert_with(|| {
            self.settings.push(settings);
            self.costs.push(vec![Self::UNKNOWN; self.rows]);
            self.settings.len() - 1
        });
        if let Some(known) = self.costs[column].get_mut(row) {
            *known = cost;
        }
    }

    /// The cost of `settings` at camera `row`, if known.
    pub fn get(&self, row: usize, settings: KnobLevels) -> Option<CostPoint> {
        self.at(row, self.column(settings)?)
    }

    /// The same by column.
    pub fn at(&self, row: usize, column: usize) -> Option<CostPoint> {
        self.costs.get(column)?.get(row).copied().filter(|cost| cost.is_finite())
    }

    /// The known costs of a column, each with its row.
    pub fn known(&self, column: usize) -> impl Iterator<Item = (usize, CostPoint)> + '_ {
        (0..self.rows).filter_map(move |row| Some((row, self.at(row, column)?)))
    }

    /// Mean error of the known costs of `settings`; `None` where none is known.
    pub fn known_mean_error(&self, settings: KnobLevels) -> Option<f64> {
        let known: Vec<f64> =
            self.known(self.column(settings)?).map(|(_, cost)| cost.error).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
    }

    /// Mean of a column over `rows`; `None` where one of them is unknown, or `rows` is empty.
    pub fn mean(&self, column: usize, rows: impl IntoIterator<Item = usize>) -> Option<CostPoint> {
        let (mut power, mut error, mut count) = (0.0, 0.0, 0.0);
        for row in rows {
            let cost = self.at(row, column)?;
            power += cost.power.0;
            error += cost.error;
            count += 1.0;
        }
        (count > 0.0).then(|| CostPoint::new(power / count, error / count))
    }

    /// Whether a column is known at every row.
    pub fn is_complete(&self, column: usize) -> bool {
        (0..self.rows).all(|row| self.at(row, column).is_some())
    }

    /// The settings that are known at every row, each with its mean cost.
    pub fn means(&self) -> impl Iterator<Item = (KnobLevels, CostPoint)> + '_ {
        let columns = self.settings.iter().enumerate();
        columns.filter_map(|(column, one)| Some((*one, self.mean(column, 0..self.rows)?)))
    }

    /// The table of the cameras in `rows`, in that order.
    #[must_use]
    pub fn with_rows(&self, rows: &[usize]) -> Self {
        let mut kept = Self { rows: rows.len(), ..self.clone() };
        for (column, costs) in kept.costs.iter_mut().zip(&self.costs) {
            *column =
                rows.iter().map(|row| costs.get(*row).copied().unwrap_or(Self::UNKNOWN)).collect();
        }
        kept
    }
}

/// Measures costs of settings at cameras: by renderers, or by a formula in tests.
pub trait Measure {
    /// Measures all of `batches`, in order or side by side, and hands over each cost as it is known,
    /// until `done` breaks. A cost is power and error in the last frame of the batch's clip.
    ///
    /// # Errors
    /// Why a rendering or its metering failed, in a sentence. What was handed over before counts.
    fn measure_all(
        &mut self,
        batches: &[Batch],
        done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    ) -> Result<(), String>;
}

/// Settings to measure at one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// The poses of consecutive frames.
    pub clip: Vec<CameraPose>,
    /// The settings.
    pub settings: Vec<KnobLevels>,
}

/// A cost of [`Measure::measure_all`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Number of the batch.
    pub batch: usize,
    /// The settings.
    pub settings: KnobLevels,
    /// Their power and error.
    pub cost: CostPoint,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_that_were_not_set_are_unknown() {
        let mut table = CostTable::new(2);
        let [a, b] = [0, 1].map(KnobLevels::from_bits);
        table.set(1, a, CostPoint::new(2.0, 0.1));
        table.set(9, b, CostPoint::new(1.0, 0.0));
        assert_eq!((table.rows(), table.settings()), (2, &[a, b][..]));
        assert_eq!(
            (table.get(0, a), table.get(1, a), table.get(1, b)),
            (None, Some(CostPoint::new(2.0, 0.1)), None)
        );
        assert_eq!(
            (table.mean(0, [0, 1]), table.mean(0, [1]), table.mean(0, [])),
            (None, Some(CostPoint::new(2.0, 0.1)), None)
        );
        assert!(!table.is_complete(0));
        table.set(0, a, CostPoint::new(4.0, 0.3));
        assert!(table.is_complete(0));
        assert_eq!(table.mean(0, [0, 1]), Some(CostPoint::new(3.0, 0.2)));
        assert_eq!(table.means().collect::<Vec<_>>(), [(a, CostPoint::new(3.0, 0.2))]);
        let part = table.with_rows(&[1]);
        assert_eq!((part.rows(), part.get(0, a)), (1, Some(CostPoint::new(2.0, 0.1))));
    }
}

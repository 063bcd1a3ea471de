//! Power by the fitted model of work.

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;

use super::Subject;
use crate::cost::{CostModel, CostReading, Work};
use crate::fit::Completion;
use crate::table::CostTable;

/// The readings of a table, with the work of their settings.
pub(super) fn readings(subject: &Subject<'_>, table: &CostTable) -> Vec<CostReading> {
    let columns = table.settings().iter().enumerate();
    let of = columns.flat_map(|(column, settings)| {
        let work = Work::of(subject.space, *settings, subject.layout);
        table.known(column).map(move |(row, cost)| CostReading {
            camera: row,
            work: work.clone(),
            power_w: cost.power.0,
        })
    });
    of.collect()
}

/// Prior weight, in readings, of a deviation of 0 of a setting from the model.
const SETTING_PRIOR: f64 = 3.0;

/// A table with power from the fitted model in place of single readings: price of the work × the
/// camera's factor × the mean deviation of the setting's readings. Errors are unchanged.
pub(super) struct Modelled {
    /// The table.
    pub table: CostTable,
    /// The model.
    pub model: CostModel,
    /// Mean deviation of each setting, in the order of the table's columns.
    deviations: Vec<f64>,
}

impl Modelled {
    /// Fits the model to `table`.
    pub(super) fn of(subject: &Subject<'_>, table: &CostTable) -> Self {
        let model = CostModel::fit(&readings(subject, table), subject.idle);
        let mut modelled =
            Self { table: CostTable::new(table.rows()), model, deviations: Vec::new() };
        for (column, settings) in table.settings().iter().enumerate() {
            let work = Work::of(subject.space, *settings, subject.layout);
            let beyond: Vec<f64> = table
                .known(column)
                .map(|(row, cost)| (cost.power.0 / modelled.model.power_at(row, &work)).ln())
                .filter(|ln| ln.is_finite())
                .collect();
            let deviation =
                (beyond.iter().sum::<f64>() / (beyond.len() as f64 + SETTING_PRIOR)).exp();
            modelled.deviations.push(deviation);
            for (row, cost) in table.known(column) {
                let power = modelled.model.power_at(row, &work) * deviation;
                modelled.table.set(row, *settings, CostPoint::new(power, cost.error));
            }
        }
        modelled
    }

    /// With errors of settings that a camera has not rendered, at the power of the model.
    pub(super) fn completed(self, subject: &Subject<'_>, completion: &Completion) -> Self {
        let power = |row: usize, settings: KnobLevels| {
            let work = Work::of(subject.space, settings, subject.layout);
            let deviation =
                self.table.column(settings).map_or(1.0, |column| self.deviations[column]);
            self.model.power_at(row, &work) * deviation
        };
        let table = completion.complete(&self.table, power);
        Self { table, ..self }
    }
}

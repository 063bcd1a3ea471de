//! Power by the fitted model of work.

use frugal_core::frontier::CostPoint;

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

/// `table` with power from the fitted model in place of single readings: price of the work × the camera's
/// factor × the mean deviation of the setting's readings. Errors are unchanged; `completion` adds those
/// of settings that a camera has not rendered. Returns the model, too.
pub(super) fn modelled(
    subject: &Subject<'_>,
    table: &CostTable,
    completion: Option<&Completion>,
) -> (CostTable, CostModel) {
    let model = CostModel::fit(&readings(subject, table), subject.idle);
    let (mut modelled, mut deviations) = (CostTable::new(table.rows()), Vec::new());
    for (column, settings) in table.settings().iter().enumerate() {
        let work = Work::of(subject.space, *settings, subject.layout);
        let beyond: Vec<f64> = table
            .known(column)
            .map(|(row, cost)| (cost.power.0 / model.power_at(row, &work)).ln())
            .filter(|ln| ln.is_finite())
            .collect();
        let deviation = (beyond.iter().sum::<f64>() / (beyond.len() as f64 + SETTING_PRIOR)).exp();
        deviations.push(deviation);
        for (row, cost) in table.known(column) {
            let power = model.power_at(row, &work) * deviation;
            modelled.set(row, *settings, CostPoint::new(power, cost.error));
        }
    }
    let Some(completion) = completion else { return (modelled, model) };
    let complete = completion.complete(&modelled, |row, settings| {
        let work = Work::of(subject.space, settings, subject.layout);
        let deviation = table.column(settings).map_or(1.0, |column| deviations[column]);
        model.power_at(row, &work) * deviation
    });
    (complete, model)
}

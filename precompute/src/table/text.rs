//! Tables as CSV: a line per camera and settings.

use std::io;

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobSpace, KnobSpaceError, RenderSettings};

use super::CostTable;

/// Why a file is no table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Not CSV, or it cannot be read.
    #[error("{0}; write the table with `frugal sweep --csv` or `frugal evaluate --record`")]
    Csv(#[from] csv::Error),
    /// A column that is not there.
    #[error("the table has no column `{0}`: it needs row (or one camera), settings, power_w and error")]
    MissingColumn(&'static str),
    /// A field that is no number.
    #[error("line {line}: {field} is `{value}`, which is not a finite number of 0 or more")]
    Number {
        /// Line of the file, from 1.
        line: u64,
        /// The column.
        field: &'static str,
        /// What stands there.
        value: String,
    },
    /// Settings that the knobs do not have.
    #[error("line {line}: {source}")]
    Settings {
        /// Line of the file, from 1.
        line: u64,
        /// What is wrong with them.
        source: KnobSpaceError,
    },
}

/// Writes every known cost: `row`, `settings` in words, `power_w` in watts, `error` as 1 − SSIM.
///
/// # Errors
/// When `to` cannot be written.
pub fn write_csv(table: &CostTable, space: &KnobSpace, to: impl io::Write) -> Result<(), TableError> {
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record(["row", "settings", "power_w", "error"])?;
    for (column, settings) in table.settings().iter().enumerate() {
        let text = space.describe(*settings);
        for row in 0..table.rows() {
            let Some(CostPoint { power, error }) = table.at(row, column) else { continue };
            writer.write_record([row.to_string(), text.clone(), power.0.to_string(), error.to_string()])?;
        }
    }
    writer.flush().map_err(csv::Error::from)?;
    Ok(())
}

/// Reads what [`write_csv`] wrote. A table without the column `row` is of one camera. Other columns are passed over.
///
/// # Errors
/// When the text is no table of `space`.
pub fn read_csv(from: impl io::Read, space: &KnobSpace) -> Result<CostTable, TableError> {
    let mut reader = csv::Reader::from_reader(from);
    let headers = reader.headers()?.clone();
    let find = |name: &'static str| headers.iter().position(|header| header == name);
    let need = |name: &'static str| find(name).ok_or(TableError::MissingColumn(name));
    let (row_at, settings_at, power_at, error_at) = (find("row"), need("settings")?, need("power_w")?, need("error")?);
    let mut entries: Vec<(usize, RenderSettings, CostPoint)> = Vec::new();
    for record in reader.records() {
        let record = record?;
        let line = record.position().map_or(0, csv::Position::line);
        let text = |at: usize| record.get(at).unwrap_or_default();
        let number = |at: usize, field: &'static str| {
            let value: f64 = text(at).trim().parse().unwrap_or(f64::NAN);
            let sound = value.is_finite() && value >= 0.0;
            if sound { Ok(value) } else { Err(TableError::Number { line, field, value: text(at).to_owned() }) }
        };
        let row = row_at.map_or(Ok(0.0), |at| number(at, "row"))? as usize;
        let settings = space.parse(text(settings_at)).map_err(|source| TableError::Settings { line, source })?;
        entries.push((row, settings, CostPoint::new(number(power_at, "power_w")?, number(error_at, "error")?)));
    }
    let mut table = CostTable::new(entries.iter().map(|(row, ..)| row + 1).max().unwrap_or(0));
    for (row, settings, cost) in entries {
        table.set(row, settings, cost);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_frugal_gi::knobs::Knob;

    fn space() -> KnobSpace {
        KnobSpace::new(vec![Knob::new("a", [0.0, 1.0]), Knob::new("b", [0.0, 1.0, 2.0])]).expect("a valid space")
    }

    #[test]
    fn a_table_survives_csv() {
        let space = space();
        let mut table = CostTable::new(3);
        for (row, settings) in [(0, space.highest()), (2, space.highest()), (1, space.lowest())] {
            table.set(row, settings, CostPoint::new(0.1 + row as f64, 1e-9));
        }
        let mut bytes = Vec::new();
        write_csv(&table, &space, &mut bytes).expect("room");
        let read = read_csv(&bytes[..], &space).expect("what was written");
        for row in 0..3 {
            assert_eq!(read.get(row, space.highest()), table.get(row, space.highest()));
            assert_eq!(read.get(row, space.lowest()), table.get(row, space.lowest()));
        }
    }

    #[test]
    fn what_is_no_table_is_refused_with_line_and_field() {
        let message = |text: &str| read_csv(text.as_bytes(), &space()).expect_err("refused").to_string();
        assert!(message("row,power_w,error\n").contains("no column `settings`"));
        let text = message("settings,power_w,error\n\"a=0,b=0\",1,0\n\"a=0,b=1\",NaN,0\n");
        assert!(text.contains("line 3") && text.contains("power_w is `NaN`"), "{text}");
        assert!(message("settings,power_w,error\n\"a=7\",1,0\n").contains("line 2"));
        assert_eq!(read_csv("settings,power_w,error\n".as_bytes(), &space()).expect("an empty table").rows(), 0);
    }
}

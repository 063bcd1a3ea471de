//! What the examples that play records have in common: their command line, and their table as JSON.

use std::path::{Path, PathBuf};

use frugal_search::evaluate::Made;
use frugal_search::testing::RecordFile;
use serde::Serialize;

/// `[FOLDER] [--json FILE]`.
pub(crate) struct Arguments {
    /// The folder of records.
    pub(crate) folder: PathBuf,
    /// Where the table goes as JSON.
    pub(crate) json: Option<PathBuf>,
}

impl Arguments {
    pub(crate) fn read() -> Result<Self, String> {
        let records = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/data/records");
        let mut found = Self { folder: records.into(), json: None };
        let mut rest = std::env::args().skip(1);
        while let Some(argument) = rest.next() {
            match argument.as_str() {
                "--json" => found.json = Some(rest.next().ok_or("--json needs a file")?.into()),
                option if option.starts_with('-') => {
                    return Err(format!("unknown option {option}"));
                }
                folder => found.folder = folder.into(),
            }
        }
        Ok(found)
    }
}

/// `value` with so many decimals: enough for a reader, and the same on every machine.
pub(crate) fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10_f64.powi(decimals);
    (value * scale).round() / scale
}

/// Writes tables that were played on `records`: how they were made, then each under its name.
pub(crate) fn write<Map>(
    file: &Path,
    records: &[(RecordFile, Map)],
    tables: &[(&str, String)],
) -> Result<(), Box<dyn std::error::Error>> {
    let mut text = format!("{{\n  \"made\": {}", serde_json::to_string(&made(records))?);
    for (name, rows) in tables {
        text.push_str(&format!(",\n  \"{name}\": {rows}"));
    }
    Ok(std::fs::write(file, text + "\n}\n")?)
}

fn made<Map>(records: &[(RecordFile, Map)]) -> Made {
    let all = |of: fn(&Made) -> &String| {
        let made = records.iter().map(|(record, _)| of(&record.made).as_str());
        let mut all: Vec<&str> = made.collect();
        all.sort_unstable();
        all.dedup();
        all.join("; ")
    };
    Made {
        machine: all(|made| &made.machine),
        driver: all(|made| &made.driver),
        date: all(|made| &made.date),
        command: vec!["make figures".to_owned()],
    }
}

/// The rows of a table as JSON, one a line, so that changes can be read.
pub(crate) fn lines(rows: &[impl Serialize]) -> serde_json::Result<String> {
    let rows: Vec<String> = rows.iter().map(serde_json::to_string).collect::<Result<_, _>>()?;
    Ok(format!("[\n    {}\n  ]", rows.join(",\n    ")))
}

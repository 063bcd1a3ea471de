//! The reader.

use std::collections::HashMap;
use std::path::Path;

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use csv::StringRecord;
use serde::Deserialize;

use super::{COLUMNS, MARK, SweepFacts, SweepTable, SweepTableError};

const SWEEP_AGAIN: &str = "sweep again with `frugal sweep --csv`";
const REMOVE_ROW: &str = "remove the row, or sweep again with `frugal sweep --csv`";

/// A fault and its location.
#[derive(Debug)]
pub(super) struct Fault {
    line: u64,
    field: String,
    reason: String,
    remedy: &'static str,
}

impl Fault {
    fn new(line: u64, field: &str, reason: impl ToString, remedy: &'static str) -> Self {
        Self { line, field: field.to_owned(), reason: reason.to_string(), remedy }
    }

    pub(super) fn of(self, path: &Path) -> SweepTableError {
        let Self { line, field, reason, remedy } = self;
        SweepTableError::Malformed { path: path.to_owned(), line, field, reason, remedy }
    }
}

/// The first line's JSON, where there is one.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Head {
    #[serde(flatten)]
    facts: SweepFacts,
    knobs: Option<KnobSpace>,
}

pub(super) fn table(text: &str, known: &KnobSpace) -> Result<SweepTable, Fault> {
    // Comments are allowed at the top only, so that a knob's label may start with any character.
    let comments = text.split_inclusive('\n').take_while(|line| line.starts_with('#'));
    let (count, length) =
        comments.fold((0, 0), |(count, length), line| (count + 1, length + line.len()));
    let head = head(&text[..length])?;
    // Rows of another length are reported here, with our own message.
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(&text.as_bytes()[length..]);
    let mut lines = reader.records().map(|record| match record {
        Ok(record) => Ok((count + record.position().map_or(0, csv::Position::line), record)),
        Err(error) => Err(Fault::new(
            count + error.position().map_or(0, csv::Position::line),
            "row",
            error,
            SWEEP_AGAIN,
        )),
    });
    let Some(header) = lines.next() else {
        return Err(Fault::new(count + 1, "header", "is not there", SWEEP_AGAIN));
    };
    let (line, header) = header?;
    let space = space(line, &header, head.knobs, known)?;
    let mut points: Vec<FrontierPoint> = Vec::new();
    let mut seen = HashMap::new();
    for row in lines {
        let (line, row) = row?;
        let point = point(line, &row, &space)?;
        if let Some(before) = seen.insert(space.canonical(point.settings), line) {
            return Err(Fault::new(
                line,
                COLUMNS.0,
                format!("the same settings as on line {before}"),
                REMOVE_ROW,
            ));
        }
        points.push(point);
    }
    if points.is_empty() {
        return Err(Fault::new(line, "row", "there is none below the header", SWEEP_AGAIN));
    }
    Ok(SweepTable { facts: head.facts, space, points })
}

fn head(comments: &str) -> Result<Head, Fault> {
    let Some(json) = comments.lines().next().and_then(|line| line.strip_prefix(MARK)) else {
        return Ok(Head::default());
    };
    serde_json::from_str(json).map_err(|error| Fault::new(1, "first line", error, SWEEP_AGAIN))
}

/// The knobs that the header names.
fn space(
    line: u64,
    header: &StringRecord,
    stated: Option<KnobSpace>,
    known: &KnobSpace,
) -> Result<KnobSpace, Fault> {
    let columns: Vec<&str> = header.iter().collect();
    let names = match columns.as_slice() {
        [first, names @ .., power, error]
            if *first == COLUMNS.0 && [*power, *error] == COLUMNS.1 =>
        {
            names
        }
        _ => {
            return Err(Fault::new(
                line,
                "header",
                "is not settings_bits, knobs, power_w, error",
                SWEEP_AGAIN,
            ));
        }
    };
    if let Some(stated) = stated {
        let agrees = stated.knobs().iter().map(|knob| knob.name.as_str()).eq(names.iter().copied());
        return if agrees {
            Ok(stated)
        } else {
            Err(Fault::new(
                line,
                "header",
                "its knobs are not those of the first line",
                SWEEP_AGAIN,
            ))
        };
    }
    let knob = |name: &&str| -> Result<Knob, Fault> {
        let index = known.index_of(name);
        let unknown = || {
            Fault::new(
                line,
                name,
                "no built-in knob has this name",
                "sweep again, so that the file says what its levels are",
            )
        };
        Ok(known.knobs()[index.ok_or_else(unknown)?].clone())
    };
    let knobs = names.iter().map(knob).collect::<Result<Vec<Knob>, Fault>>()?;
    KnobSpace::new(knobs).map_err(|error| Fault::new(line, "header", error, SWEEP_AGAIN))
}

fn point(line: u64, row: &StringRecord, space: &KnobSpace) -> Result<FrontierPoint, Fault> {
    let expected = space.len() + 3;
    if row.len() != expected {
        let reason =
            format!("has {} fields, not {expected}: the file was cut off or changed", row.len());
        return Err(Fault::new(line, "row", reason, REMOVE_ROW));
    }
    let mut settings = KnobLevels::default();
    for (index, (knob, label)) in space.knobs().iter().zip(row.iter().skip(1)).enumerate() {
        let Some(level) = knob.levels.iter().position(|level| level.label == label) else {
            let labels: Vec<&str> = knob.levels.iter().map(|level| level.label.as_str()).collect();
            return Err(Fault::new(
                line,
                &knob.name,
                format!("`{label}` is none of its levels, {}", labels.join(", ")),
                SWEEP_AGAIN,
            ));
        };
        settings = settings.with_level(index, level);
    }
    let bits = &row[0];
    if bits.parse() != Ok(settings.bits()) {
        let reason = format!(
            "`{bits}` where the levels make {}: the file was changed, or its knobs have other levels now",
            settings.bits()
        );
        return Err(Fault::new(line, COLUMNS.0, reason, SWEEP_AGAIN));
    }
    let power =
        number(line, row, expected - 2, "must be a finite number above 0", |power| power > 0.0)?;
    let error = number(line, row, expected - 1, "must be a finite number", |_| true)?;
    Ok(FrontierPoint { settings, cost: CostPoint::new(power, error) })
}

fn number(
    line: u64,
    row: &StringRecord,
    column: usize,
    rule: &str,
    is_right: impl Fn(f64) -> bool,
) -> Result<f64, Fault> {
    let text = &row[column];
    let field = COLUMNS.1[usize::from(column + 1 == row.len())];
    let number =
        text.trim().parse().ok().filter(|number: &f64| number.is_finite() && is_right(*number));
    number.ok_or_else(|| Fault::new(line, field, format!("`{text}` {rule}"), REMOVE_ROW))
}

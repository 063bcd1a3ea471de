//! The format of control logs: see [the module](super).

use std::str::FromStr;

use super::{ControlLogError, ControlSample};
use crate::text_lines::{quote, unmarked, whole_lines};

/// Names of the columns, in order; a suffix gives the unit.
pub const COLUMNS: [&str; 16] = [
    "time_s",
    "camera",
    "status",
    "held_by",
    "power_budget_w",
    "app_budget_w",
    "predicted_w",
    "metered_w",
    "meter",
    "error_budget",
    "predicted_error",
    "measured_error",
    "frame_ms",
    "longest_frame_ms",
    "switches",
    "settings",
];

/// Maximum number of characters that an error quotes from a file.
const QUOTE: usize = 60;

/// The first line.
pub(super) fn header() -> String {
    format!("{}\n", COLUMNS.join(","))
}

/// Appends a sample's line. Numbers have enough digits to restore every bit.
pub(super) fn push_line(text: &mut String, sample: &ControlSample) {
    let optional =
        |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:?}"));
    let fields = [
        format!("{:?}", sample.time_s),
        sample.camera.to_string(),
        quoted(&sample.status),
        quoted(&sample.held_by),
        optional(sample.power_budget_w),
        optional(sample.app_budget_w),
        optional(sample.predicted_w),
        optional(sample.metered_w),
        quoted(&sample.meter),
        optional(sample.error_budget),
        optional(sample.predicted_error),
        optional(sample.measured_error),
        optional(sample.frame_ms),
        optional(sample.longest_frame_ms),
        sample.switches.to_string(),
        quoted(&sample.settings),
    ];
    text.push_str(&fields.join(","));
    text.push('\n');
}

/// A text as one field (RFC 4180), in one line: names of knobs and meters are the app's own.
fn quoted(text: &str) -> String {
    let line = text.replace(['\n', '\r'], " ");
    if line.contains([',', '"']) { format!("\"{}\"", line.replace('"', "\"\"")) } else { line }
}

/// The text of a log of `samples`, which [`parse`] restores bit by bit if no text has a line break
/// and all numbers are finite.
pub fn to_text<'a>(samples: impl IntoIterator<Item = &'a ControlSample>) -> String {
    let mut text = header();
    for sample in samples {
        push_line(&mut text, sample);
    }
    text
}

/// Parses the samples of a log, in file order. Ignores empty lines and an unterminated last line, as
/// a crash or a full disk leaves it. Accepts a byte order mark and CRLF line ends.
///
/// # Errors
///
/// [`ControlLogError`] when the text is not a log, or has an invalid line; it names line, field and
/// remedy.
pub fn parse(text: &str) -> Result<Vec<ControlSample>, ControlLogError> {
    let text = unmarked(text);
    let mut lines = whole_lines(text);
    let first = lines.next().map_or(text, |(_, line)| line);
    if !first.split(',').map(str::trim).eq(COLUMNS) {
        return Err(ControlLogError::Columns { found: quote(first, QUOTE) });
    }
    lines.filter(|(_, line)| !line.is_empty()).map(|(line, text)| parse_line(line, text)).collect()
}

fn parse_line(line: usize, text: &str) -> Result<ControlSample, ControlLogError> {
    let fields = fields(text);
    if fields.len() != COLUMNS.len() {
        return Err(ControlLogError::FieldCount { line, found: fields.len() });
    }
    let invalid = |column: usize, expected: &'static str| ControlLogError::NotANumber {
        line,
        field: COLUMNS[column],
        found: quote(&fields[column], QUOTE),
        expected,
    };
    let number = |column: usize| {
        let number = fields[column].trim().parse().ok().filter(|value: &f64| value.is_finite());
        number.ok_or_else(|| invalid(column, "finite number"))
    };
    let optional = |column: usize| {
        if fields[column].trim().is_empty() { Ok(None) } else { number(column).map(Some) }
    };
    let whole = |column: usize| {
        u32::from_str(fields[column].trim())
            .map_err(|_| invalid(column, "whole number from 0 to 4294967295"))
    };
    let text = |column: usize| fields[column].clone();
    Ok(ControlSample {
        time_s: number(0)?,
        camera: whole(1)?,
        status: text(2),
        held_by: text(3),
        power_budget_w: optional(4)?,
        app_budget_w: optional(5)?,
        predicted_w: optional(6)?,
        metered_w: optional(7)?,
        meter: text(8),
        error_budget: optional(9)?,
        predicted_error: optional(10)?,
        measured_error: optional(11)?,
        frame_ms: optional(12)?,
        longest_frame_ms: optional(13)?,
        switches: whole(14)?,
        settings: text(15),
    })
}

/// The fields of a line (RFC 4180). A quotation that does not end goes on to the end of the line.
fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let (mut is_quoted, mut characters) = (false, line.chars().peekable());
    while let Some(character) = characters.next() {
        let field = fields.last_mut().expect("there is always a field");
        match character {
            '"' if is_quoted && characters.peek() == Some(&'"') => {
                field.push('"');
                characters.next();
            }
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => fields.push(String::new()),
            other => field.push(other),
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn samples() -> [ControlSample; 2] {
        let full = ControlSample {
            time_s: 1.25,
            camera: 3,
            status: "met".into(),
            held_by: "Power".into(),
            power_budget_w: Some(7.5),
            app_budget_w: Some(12.0),
            predicted_w: Some(7.1),
            metered_w: Some(0.1 + 0.2),
            meter: "a \"fine\" meter, modelled".into(),
            error_budget: Some(0.02),
            predicted_error: Some(1e-300),
            measured_error: Some(0.021),
            frame_ms: Some(16.6),
            longest_frame_ms: Some(33.3),
            switches: 2,
            settings: "gi_vpl_count=1,024 fog=\"thick\"".into(),
        };
        [full, ControlSample::default()]
    }

    #[test]
    fn a_log_reads_back_as_it_was_written() {
        let text = to_text(&samples());
        assert_eq!(parse(&text), Ok(samples().to_vec()));
        assert_eq!(parse(&format!("\u{feff}{}", text.replace('\n', "\r\n"))), Ok(samples().into()));
        assert_eq!(parse(&header()), Ok(vec![]));
        // Truncated anywhere after the header: only the last line is lost.
        for end in header().len()..text.len() {
            if text.is_char_boundary(end) {
                let read = parse(&text[..end]).expect("a log");
                assert!(read.len() < 2 && read[..] == samples()[..read.len()], "{end}");
            }
        }
    }

    #[test]
    fn a_faulty_line_is_named() {
        let text = to_text(&samples());
        let error = |from: &str, to: &str| parse(&text.replacen(from, to, 1)).unwrap_err();
        for (from, to, expected) in [
            ("time_s", "times", "line 1: `times,camera"),
            ("7.5", "seven", "line 2: `power_budget_w` is `seven`"),
            ("7.1", "inf", "line 2: `predicted_w` is `inf`, which is not a finite number"),
            ("1.25,3", "1.25,-3", "line 2: `camera` is `-3`"),
            ("1.25,3,met", "1.25,3", "line 2: 15 fields instead of 16"),
        ] {
            let message = error(from, to).to_string();
            assert!(message.starts_with(expected), "{message}");
        }
        assert!(parse("").is_err() && parse("no newline").is_err());
    }

    proptest! {
        #[test]
        fn any_text_in_a_field_survives(meter in "[^\r\n]{0,40}", settings in "[^\r\n]{0,40}") {
            let settings = settings.trim_end().to_owned();
            let sample = ControlSample { meter, settings, ..ControlSample::default() };
            prop_assert_eq!(parse(&to_text([&sample])), Ok(vec![sample.clone()]));
        }

        #[test]
        fn no_text_panics(text in "\\PC{0,300}") {
            let _ = parse(&text);
            let _ = parse(&format!("{}{text}\n", header()));
        }
    }
}

//! The format of camera recordings: see [the module](super).

use std::fmt::Write;
use std::str::FromStr;

use bevy::math::{Quat, Vec3};

use super::{CameraFileError, CameraSample};
use crate::text_lines::{quote, unmarked, whole_lines};

/// Version of the format that this build writes and reads.
pub const VERSION: u32 = 1;

/// First word of a file.
pub(super) const NAME: &str = "frugal-cameras";

/// Names of the columns, in order; a suffix gives the unit.
pub const COLUMNS: [&str; 11] =
    ["time_s", "camera", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "vertical_fov_rad", "aspect"];

/// Maximum number of characters that an error quotes from a file.
const QUOTE: usize = 40;

/// The first two lines.
pub(super) fn header() -> String {
    format!("{NAME} {VERSION}\n{}\n", COLUMNS.join(","))
}

/// Appends a sample's line, with enough digits to restore every bit.
pub(super) fn push_line(text: &mut String, sample: &CameraSample) {
    let CameraSample { time_s, camera, position: p, rotation: q, vertical_fov, aspect } = sample;
    // Writing to a string cannot fail.
    let _ = write!(text, "{time_s:?},{camera},{:?},{:?},{:?}", p.x, p.y, p.z);
    let _ = writeln!(text, ",{:?},{:?},{:?},{:?},{vertical_fov:?},{aspect:?}", q.x, q.y, q.z, q.w);
}

/// The text of a recording of `samples`. [`parse`] restores them bit by bit if they are
/// [valid](CameraSample::validated) and their rotations have unit length.
pub fn to_text<'a>(samples: impl IntoIterator<Item = &'a CameraSample>) -> String {
    let mut text = header();
    for sample in samples {
        push_line(&mut text, sample);
    }
    text
}

/// Parses the samples of a recording, in file order, each [valid](CameraSample::validated). Ignores
/// empty lines and an unterminated last line, as a crash or a full disk leaves it. Accepts a byte
/// order mark and CRLF line ends.
///
/// # Errors
///
/// [`CameraFileError`] when the text is not a recording, is of another version, or has an invalid
/// line; it names line, field and remedy.
pub fn parse(text: &str) -> Result<Vec<CameraSample>, CameraFileError> {
    let text = unmarked(text);
    let mut lines = whole_lines(text);
    let first = lines.next().map_or(text, |(_, line)| line);
    let no_header = || CameraFileError::Header { found: quote(first, QUOTE) };
    let version =
        first.strip_prefix(NAME).and_then(|rest| rest.strip_prefix(' ')).ok_or_else(no_header)?;
    match version.parse() {
        Ok(VERSION) => {}
        Ok(found) => return Err(CameraFileError::Version { found }),
        Err(_) => return Err(no_header()),
    }
    let Some((_, columns)) = lines.next() else { return Ok(Vec::new()) };
    if !columns.split(',').map(str::trim).eq(COLUMNS) {
        return Err(CameraFileError::Columns { found: quote(columns, QUOTE) });
    }
    lines
        .filter(|(_, line)| !line.is_empty())
        .map(|(number, line)| parse_line(number, line))
        .collect()
}

fn parse_line(line: usize, text: &str) -> Result<CameraSample, CameraFileError> {
    let mut fields = [""; COLUMNS.len()];
    let found = text.split(',').count();
    if found != fields.len() {
        return Err(CameraFileError::FieldCount { line, found });
    }
    for (field, text) in fields.iter_mut().zip(text.split(',')) {
        *field = text.trim();
    }
    let number = |column| field::<f32>(line, column, fields[column], "number");
    let sample = CameraSample {
        time_s: field(line, 0, fields[0], "number")?,
        camera: field(line, 1, fields[1], "whole number from 0 to 4294967295")?,
        position: Vec3::new(number(2)?, number(3)?, number(4)?),
        rotation: Quat::from_xyzw(number(5)?, number(6)?, number(7)?, number(8)?),
        vertical_fov: number(9)?,
        aspect: number(10)?,
    };
    sample.validated().map_err(|number| CameraFileError::OutOfRange { line, number })
}

fn field<T: FromStr>(
    line: usize,
    column: usize,
    text: &str,
    expected: &'static str,
) -> Result<T, CameraFileError> {
    let error = |_| CameraFileError::NotANumber {
        line,
        field: COLUMNS[column],
        found: quote(text, QUOTE),
        expected,
    };
    text.parse().map_err(error)
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;

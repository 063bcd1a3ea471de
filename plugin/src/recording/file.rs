//! The format of files of cameras: see [the module](super).

use std::fmt::Write;
use std::str::FromStr;

use bevy::math::{Quat, Vec3};

use super::{CameraFileError, CameraSample};

/// Version of the format that is written and read.
pub const VERSION: u32 = 1;

/// First word of a file.
pub(super) const NAME: &str = "frugal-cameras";

/// Names of the columns, in order.
pub const COLUMNS: [&str; 11] = [
    // With their units.
    "time_s",
    "camera",
    "x_m",
    "y_m",
    "z_m",
    "qx",
    "qy",
    "qz",
    "qw",
    "vertical_fov_rad",
    "aspect",
];

/// Characters of somebody else's text that an error repeats.
const QUOTE: usize = 40;

/// The first two lines.
pub(super) fn header() -> String {
    format!("{NAME} {VERSION}\n{}\n", COLUMNS.join(","))
}

/// Appends a sample's line, with as many digits as give back every bit.
pub(super) fn push_line(text: &mut String, sample: &CameraSample) {
    let CameraSample { time_s, camera, position: p, rotation: q, vertical_fov, aspect } = sample;
    // Writing into a string cannot fail.
    let _ = write!(text, "{time_s:?},{camera},{:?},{:?},{:?}", p.x, p.y, p.z);
    let _ = writeln!(text, ",{:?},{:?},{:?},{:?},{vertical_fov:?},{aspect:?}", q.x, q.y, q.z, q.w);
}

/// A whole file of `samples`, which [`parse`] gives back bit by bit where they are
/// [valid](CameraSample::validated) and their rotations of unit length.
pub fn to_text<'a>(samples: impl IntoIterator<Item = &'a CameraSample>) -> String {
    let mut text = header();
    for sample in samples {
        push_line(&mut text, sample);
    }
    text
}

/// The samples of a file, in its order, every one [valid](CameraSample::validated). A last line
/// without its end, which a crash or a full disk leaves behind, is passed over, as are empty lines;
/// lines may end as on Windows.
///
/// # Errors
///
/// The text is no such file or of another version, or a line has a number that cannot be: the error
/// names line, field and remedy.
pub fn parse(text: &str) -> Result<Vec<CameraSample>, CameraFileError> {
    // Some editors put a byte order mark before what they save.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text
        .split_inclusive('\n')
        .map(str::trim_end)
        .enumerate()
        .map(|(index, line)| (index + 1, line));
    let mut lines = lines.take(text.matches('\n').count());

    let first = lines.next().map_or(text, |(_, line)| line);
    let no_header = || CameraFileError::Header { found: quote(first) };
    let version =
        first.strip_prefix(NAME).and_then(|rest| rest.strip_prefix(' ')).ok_or_else(no_header)?;
    match version.parse() {
        Ok(VERSION) => {}
        Ok(found) => return Err(CameraFileError::Version { found }),
        Err(_) => return Err(no_header()),
    }
    let Some((_, columns)) = lines.next() else { return Ok(Vec::new()) };
    if !columns.split(',').map(str::trim).eq(COLUMNS) {
        return Err(CameraFileError::Columns { found: quote(columns) });
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
        found: quote(text),
        expected,
    };
    text.parse().map_err(error)
}

fn quote(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    line.chars().take(QUOTE).collect()
}

#[cfg(test)]
#[path = "file_tests.rs"]
mod tests;

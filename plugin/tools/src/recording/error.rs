//! Errors of camera recordings.

use super::file::{COLUMNS, VERSION};

/// A number of a camera sample that is out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{field}` is {value}, which must be {expected}")]
#[non_exhaustive]
pub struct InvalidSample {
    /// Column of the file, or columns separated by commas.
    pub field: &'static str,
    /// Its value, in the column's unit.
    pub value: f64,
    /// Its valid range, in words.
    pub expected: &'static str,
}

/// Why a text is not a valid camera recording. The message includes the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// Another kind of file, or an empty one.
    #[error(
        "line 1: `{found}` instead of `frugal-cameras {known}`: give a file that CameraRecorderPlugin wrote",
        known = VERSION
    )]
    Header {
        /// Beginning of the line.
        found: String,
    },
    /// Written by another version of this crate.
    #[error(
        "line 1: format version {found}, but this build reads {known}: \
         read it with the bevy_frugal_gi that wrote it, or record again",
        known = VERSION
    )]
    Version {
        /// The file's version.
        found: u32,
    },
    /// The columns have other names, or another order.
    #[error("line 2: `{found}` instead of `{}`: restore the line, or record again", COLUMNS.join(","))]
    Columns {
        /// Beginning of the line.
        found: String,
    },
    /// A sample with too few numbers, or too many.
    #[error("line {line}: {found} fields instead of {}: correct the line, or remove it", COLUMNS.len())]
    FieldCount {
        /// Line, from 1.
        line: usize,
        /// Number of fields in the line.
        found: usize,
    },
    /// A field that is not a number of its column's kind.
    #[error(
        "line {line}: `{field}` is `{found}`, which is not a {expected}: correct the line, or remove it"
    )]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// Column.
        field: &'static str,
        /// Beginning of the field.
        found: String,
        /// The expected kind of number, in words.
        expected: &'static str,
    },
    /// A number out of its range.
    #[error("line {line}: {number}: correct the line, or remove it")]
    OutOfRange {
        /// Line, from 1.
        line: usize,
        /// The number and its valid range.
        number: InvalidSample,
    },
}

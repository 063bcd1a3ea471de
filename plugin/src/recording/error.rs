//! Why a file of cameras cannot be read.

use super::file::{COLUMNS, VERSION};

/// A number of a camera sample that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{field}` is {value}, which must be {expected}")]
pub struct InvalidSample {
    /// Column of the file, or columns.
    pub field: &'static str,
    /// What it holds.
    pub value: f64,
    /// What it should hold.
    pub expected: &'static str,
}

/// Why text is no file of cameras, with what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// Another kind of file, or none.
    #[error(
        "line 1: `{found}` where `frugal-cameras {known}` should be: name a file that CameraRecorderPlugin wrote",
        known = VERSION
    )]
    Header {
        /// How the line begins.
        found: String,
    },
    /// Written by another version of this crate.
    #[error(
        "line 1: format version {found}, while this build reads {known}: \
         read it with the bevy_frugal_gi that wrote it, or record again",
        known = VERSION
    )]
    Version {
        /// The file's version.
        found: u32,
    },
    /// The columns have other names, or another order.
    #[error("line 2: `{found}` where `{}` should be: restore the line, or record again", COLUMNS.join(","))]
    Columns {
        /// How the line begins.
        found: String,
    },
    /// A sample with too few numbers, or too many.
    #[error("line {line}: {found} fields where {} should be: correct the line, or remove it", COLUMNS.len())]
    FieldCount {
        /// Line, from 1.
        line: usize,
        /// How many there are.
        found: usize,
    },
    /// A field that is no number, or no number of its kind.
    #[error(
        "line {line}: `{field}` is `{found}`, which is no {expected}: correct the line, or remove it"
    )]
    NotANumber {
        /// Line, from 1.
        line: usize,
        /// Column.
        field: &'static str,
        /// How the field begins.
        found: String,
        /// The kind of number.
        expected: &'static str,
    },
    /// A number that cannot be.
    #[error("line {line}: {number}: correct the line, or remove it")]
    OutOfRange {
        /// Line, from 1.
        line: usize,
        /// Which, and why.
        number: InvalidSample,
    },
}

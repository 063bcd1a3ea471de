//! Errors of control logs.

use super::file::COLUMNS;

/// Why a text is not a valid control log. The message includes the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ControlLogError {
    /// Another kind of file, or one of another version.
    #[error(
        "line 1: `{found}` instead of `{}`: give a file that ControlLogPlugin of this version wrote",
        COLUMNS.join(",")
    )]
    Columns {
        /// Beginning of the line.
        found: String,
    },
    /// A line with too few fields, or too many.
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
}

//! Why there is no journal.

use std::path::PathBuf;

use crate::files::FileError;

/// Why there is no journal. The text is the fault alone: what helps depends on the options of the
/// command, which adds it.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// A file operation failed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a journal, or its first line is damaged.
    #[error("`{path}` is not a journal of this version, or its first line is damaged", path = path.display())]
    NotAJournal {
        /// The file.
        path: PathBuf,
    },
    /// The journal holds an earlier run's records, which nobody asked to use or to drop.
    #[error("the journal `{path}` holds {records} records of an earlier run", path = path.display())]
    HasRecords {
        /// The journal.
        path: PathBuf,
        /// How many.
        records: usize,
    },
    /// The journal belongs to another run.
    #[error(
        "the journal `{path}` is of another run: its {field} is `{found}`, here it is `{expected}`",
        path = path.display()
    )]
    OtherRun {
        /// The journal.
        path: PathBuf,
        /// The field that differs.
        field: String,
        /// The journal's value.
        found: String,
        /// This run's value.
        expected: String,
    },
    /// Another process has the journal open.
    #[error("the journal `{path}` is in use by another process", path = path.display())]
    InUse {
        /// The journal.
        path: PathBuf,
    },
    /// The header cannot be written as text.
    #[error("the journal's header cannot be written: {0}")]
    Header(#[from] serde_json::Error),
}

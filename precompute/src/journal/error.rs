//! Why there is no journal.

use std::io;
use std::path::PathBuf;

/// Why there is no journal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum JournalError {
    /// A file operation failed.
    #[error("cannot {action} the journal `{path}`: {source}; free some disk space or choose another location", path = path.display())]
    File {
        /// The operation.
        action: &'static str,
        /// The journal.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file is not a journal, or its first line is damaged.
    #[error("`{path}` is not a journal of this version: move it away, or run without --resume to start anew", path = path.display())]
    NotAJournal {
        /// The file.
        path: PathBuf,
    },
    /// The journal belongs to another run.
    #[error(
        "the journal `{path}` is of another run: its {field} is `{found}`, here it is `{expected}`; resume with the same, or run without --resume to start anew",
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
    #[error("the journal `{path}` is in use: wait for the other run, or give this one another output", path = path.display())]
    InUse {
        /// The journal.
        path: PathBuf,
    },
    /// The header cannot be written as text.
    #[error("the journal's header cannot be written: {0}")]
    Header(#[from] serde_json::Error),
}

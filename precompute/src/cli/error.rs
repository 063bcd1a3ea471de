//! Errors of commands, and their exit status.

use frugal_search::files::FileError;

use crate::report::ReportError;
use crate::scene::SceneError;
use crate::stage::{RemoteError, StageError};

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// Invalid arguments or input: nothing was written.
    #[error("{0}")]
    Usage(String),
    /// The command failed after it had started.
    #[error("{0}")]
    Failed(String),
    /// The command finished, and its check failed.
    #[error("{0}")]
    Regressed(String),
}

impl CliError {
    /// Invalid arguments or input.
    pub(super) fn usage(error: impl ToString) -> Self {
        Self::Usage(error.to_string())
    }

    /// A failure after the start.
    pub(super) fn failed(error: impl ToString) -> Self {
        Self::Failed(error.to_string())
    }

    /// The process's exit status.
    pub(super) fn status(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Failed(_) => 1,
            Self::Regressed(_) => 3,
        }
    }
}

impl From<SceneError> for CliError {
    fn from(error: SceneError) -> Self {
        Self::usage(error)
    }
}

impl From<StageError> for CliError {
    fn from(error: StageError) -> Self {
        if error.is_usage() { Self::usage(error) } else { Self::failed(error) }
    }
}

impl From<RemoteError> for CliError {
    fn from(error: RemoteError) -> Self {
        if error.usage { Self::usage(error) } else { Self::failed(error) }
    }
}

impl From<FileError> for CliError {
    fn from(error: FileError) -> Self {
        Self::failed(error)
    }
}

impl From<ReportError> for CliError {
    fn from(error: ReportError) -> Self {
        Self::failed(error)
    }
}

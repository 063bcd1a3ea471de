//! Why a frontier map cannot be used.

use super::SceneIdentity;

/// The version of the format.
pub(super) const VERSION: u32 = 1;

/// Why a frontier map cannot be read, written or used. Most messages include the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrontierMapError {
    /// The text is not a frontier map, or is truncated.
    #[error(
        "line {line}, column {column}: {reason}: the file is no frontier map, is cut off or was edited; `frugal precompute` makes one"
    )]
    Parse {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The parser's message.
        reason: String,
    },
    /// Written by another version of this crate.
    #[error(
        "frontier map of format version {found}, but this build reads version {known}: run the `frugal precompute` of the same release again",
        known = VERSION
    )]
    OtherVersion {
        /// The file's version.
        found: u32,
    },
    /// A number out of its range.
    #[error(
        "frontier map with {field} = {value}, which must be {expected}: correct it, or run `frugal precompute` again"
    )]
    OutOfRange {
        /// Path of the field.
        field: &'static str,
        /// Its value, as text.
        value: String,
        /// Its valid range, in words.
        expected: &'static str,
    },
    /// Octree, settings or costs that contradict each other.
    #[error("invalid frontier map: {0}: run `frugal precompute` again")]
    Invalid(String),
    /// Made for another scene, or for an earlier state of this one.
    #[error(
        "frontier map of scene `{}` ({}), but the scene is `{}` ({}): run `frugal precompute` again for this scene",
        map.name, map.fingerprint, scene.name, scene.fingerprint
    )]
    OtherScene {
        /// The scene of the map.
        map: SceneIdentity,
        /// The scene that was compared with it.
        scene: SceneIdentity,
    },
    /// The serialiser failed.
    #[error("frontier map cannot be written: {reason}")]
    Unwritable {
        /// The serialiser's message.
        reason: String,
    },
}

impl FrontierMapError {
    /// Whether this build reads maps of version `found`.
    pub fn check_version(found: u32) -> Result<(), Self> {
        if found == VERSION { Ok(()) } else { Err(Self::OtherVersion { found }) }
    }
}

impl From<ron::error::SpannedError> for FrontierMapError {
    fn from(error: ron::error::SpannedError) -> Self {
        // The end of the span is the parser's position: for a truncated file, its last line.
        Self::Parse {
            line: error.span.end.line,
            column: error.span.end.col,
            reason: error.code.to_string(),
        }
    }
}

//! Why a frontier map cannot be used.

use super::{FrontierMap, OctreeError, SceneIdentity};

/// Why a frontier map cannot be read, written or used, with what to do about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrontierMapError {
    /// The text is no frontier map, or only a part of one.
    #[error(
        "line {line}, column {column}: {reason}: the file is cut off or was changed, run `frugal precompute` again"
    )]
    Parse {
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What the parser met.
        reason: String,
    },
    /// Written by a newer version of this crate.
    #[error(
        "frontier map of format version {found}, newer than {known}, which is all that this build reads: update bevy_frugal_gi, or run its own `frugal precompute` again",
        known = FrontierMap::VERSION
    )]
    Newer {
        /// The file's version.
        found: u32,
    },
    /// Written by an older version of this crate.
    #[error("frontier map of format version {found}, older than {known}: run `frugal precompute` again", known = FrontierMap::VERSION)]
    Older {
        /// The file's version.
        found: u32,
    },
    /// A number that cannot be.
    #[error(
        "frontier map with {field} = {value}, which must be {expected}: correct it, or run `frugal precompute` again"
    )]
    OutOfRange {
        /// Path of the field.
        field: &'static str,
        /// What it holds.
        value: String,
        /// What it should hold.
        expected: &'static str,
    },
    /// The octree contradicts itself.
    #[error("broken frontier map: {0}: run `frugal precompute` again")]
    Octree(#[from] OctreeError),
    /// Settings with a level that the map's knobs do not have.
    #[error(
        "frontier {frontier} has settings {bits}, which the map's knobs do not have: run `frugal precompute` again"
    )]
    UnknownSettings {
        /// Index of the frontier.
        frontier: usize,
        /// The packed settings.
        bits: u64,
    },
    /// A power below 0, or an error outside 0 to 2.
    #[error(
        "frontier {frontier} has a point of {power_w} W and error {error}, which cannot be: run `frugal precompute` again"
    )]
    ImpossibleCost {
        /// Index of the frontier.
        frontier: usize,
        /// Power, watts.
        power_w: f64,
        /// Error.
        error: f64,
    },
    /// Made for another scene, or for this one before it changed.
    #[error(
        "frontier map of scene `{}` ({}), while the scene is `{}` ({}): run `frugal precompute` again for this scene",
        map.name, map.fingerprint, scene.name, scene.fingerprint
    )]
    OtherScene {
        /// The scene that the map is of.
        map: SceneIdentity,
        /// The scene at hand.
        scene: SceneIdentity,
    },
    /// The serialiser failed.
    #[error("frontier map cannot be written: {reason}")]
    Unwritable {
        /// What it said.
        reason: String,
    },
}

impl FrontierMapError {
    pub(super) fn check_version(found: u32) -> Result<(), Self> {
        match found.cmp(&FrontierMap::VERSION) {
            std::cmp::Ordering::Greater => Err(Self::Newer { found }),
            std::cmp::Ordering::Less => Err(Self::Older { found }),
            std::cmp::Ordering::Equal => Ok(()),
        }
    }
}

impl From<ron::error::SpannedError> for FrontierMapError {
    fn from(error: ron::error::SpannedError) -> Self {
        // The end of the span is where the parser stood: for a file that is cut off, its last line.
        Self::Parse {
            line: error.span.end.line,
            column: error.span.end.col,
            reason: error.code.to_string(),
        }
    }
}

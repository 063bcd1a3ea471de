//! Checks of a map, and why one cannot be used.

use std::fmt::Debug;

use super::{Bounds, Capture, FrontierMap, SceneIdentity, Thresholds};

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

impl FrontierMap {
    /// Checks everything that the controller relies on: version, ranges, octree, settings and
    /// costs.
    ///
    /// # Errors
    /// The first fault found: another version, a number out of range, an invalid octree, or
    /// settings with a level that the knobs lack.
    pub fn validate(&self) -> Result<(), FrontierMapError> {
        FrontierMapError::check_version(self.version)?;
        let Capture { size, frames_per_second: rate, vertical_fov, exposure_ev100 } = self.capture;
        let Thresholds { power_w, error } = self.thresholds;
        let (Bounds { min, max }, extent) = (self.bounds, self.bounds.extent());
        let is_amount = |number: f64| number.is_finite() && number >= 0.0;
        let is_finite = |corner: [f32; 3]| corner.iter().all(|coordinate| coordinate.is_finite());
        let is_rate = rate.is_finite() && rate > 0.0;
        let is_box = extent.is_finite() && extent.min_element() > 0.0;
        let is_fov = vertical_fov > 0.0 && vertical_fov < 180.0;
        let shared = &self.work_prices.shared;
        let checks: [(&'static str, &dyn Debug, bool, &'static str); 13] = [
            ("capture.size", &size, size[0] > 0 && size[1] > 0, "two numbers above 0"),
            ("capture.frames_per_second", &rate, is_rate, "finite and above 0"),
            ("capture.vertical_fov", &vertical_fov, is_fov, "above 0 and below 180 degrees"),
            ("capture.exposure_ev100", &exposure_ev100, exposure_ev100.is_finite(), "finite"),
            ("thresholds.power_w", &power_w, is_amount(power_w), "finite and at least 0"),
            ("thresholds.error", &error, is_amount(error), "finite and at least 0"),
            ("bounds.min", &min, is_finite(min), "finite"),
            ("bounds.max", &max, is_finite(max), "finite"),
            ("bounds", &self.bounds, is_box, "of an extent above 0 on each axis"),
            (
                "error_rates",
                &self.error_rates,
                self.error_rates.is_sound(),
                "increasing budgets with finite, non-increasing rates of at least 0",
            ),
            (
                "work_prices",
                &self.work_prices,
                self.work_prices.is_sound(),
                "as many kinds as prices, all finite and at least 0",
            ),
            (
                "work_prices.shared",
                shared,
                shared.is_sound(&self.knobs),
                "at most four of the map's knobs, with a finite energy of at least 0 for each combination of levels",
            ),
            (
                "knob_effects",
                &self.knob_effects,
                self.knob_effects.is_sound(&self.knobs),
                "a finite energy of at least 0 and an error from 0 to 2 for each level of each knob",
            ),
        ];
        if let Some((field, value, _, expected)) = checks.into_iter().find(|check| !check.2) {
            return Err(FrontierMapError::OutOfRange {
                field,
                value: format!("{value:?}"),
                expected,
            });
        }
        self.octree
            .validate()
            .and_then(|()| self.validate_frontiers())
            .map_err(FrontierMapError::Invalid)
    }

    fn validate_frontiers(&self) -> Result<(), String> {
        for (frontier, points) in self.octree.frontiers.iter().chain([&self.shared]).enumerate() {
            for point in points.points() {
                let bits = point.settings.bits();
                if !self.knobs.contains(point.settings) {
                    return Err(format!(
                        "frontier {frontier} has settings {bits}, which the map's knobs lack"
                    ));
                }
                let (power_w, error) = (point.cost.power.0, point.cost.error);
                if !(power_w.is_finite() && power_w >= 0.0 && (0.0..=2.0).contains(&error)) {
                    return Err(format!(
                        "frontier {frontier} has a point of {power_w} W and error {error}, where power must be finite and at least 0 and error 0 to 2"
                    ));
                }
            }
        }
        Ok(())
    }
}

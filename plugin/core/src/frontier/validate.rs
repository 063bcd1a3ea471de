//! Checks of a map.

use super::map_error::FrontierMapError;
use super::{Bounds, Capture, FrontierMap, Thresholds};

impl FrontierMap {
    /// Checks everything that the controller relies on: version, ranges, octree, settings and
    /// costs.
    ///
    /// # Errors
    /// The first fault found: another version, a number out of range, an invalid octree, or
    /// settings with a level that the knobs lack.
    pub fn validate(&self) -> Result<(), FrontierMapError> {
        FrontierMapError::check_version(self.version)?;
        let Capture { size, frames_per_second, vertical_fov, exposure_ev100 } = self.capture;
        check("capture.size", size, size[0] > 0 && size[1] > 0, "two numbers above 0")?;
        let positive = frames_per_second.is_finite() && frames_per_second > 0.0;
        check("capture.frames_per_second", frames_per_second, positive, "finite and above 0")?;
        check(
            "capture.vertical_fov",
            vertical_fov,
            vertical_fov > 0.0 && vertical_fov < 180.0,
            "above 0 and below 180 degrees",
        )?;
        check("capture.exposure_ev100", exposure_ev100, exposure_ev100.is_finite(), "finite")?;
        let Thresholds { power_w, error } = self.thresholds;
        check(
            "thresholds.power_w",
            power_w,
            power_w.is_finite() && power_w >= 0.0,
            "finite and at least 0",
        )?;
        check(
            "thresholds.error",
            error,
            error.is_finite() && error >= 0.0,
            "finite and at least 0",
        )?;
        let Bounds { min, max } = self.bounds;
        check("bounds.min", min, min.iter().all(|coordinate| coordinate.is_finite()), "finite")?;
        check("bounds.max", max, max.iter().all(|coordinate| coordinate.is_finite()), "finite")?;
        let extent = self.bounds.extent();
        check(
            "bounds",
            self.bounds,
            extent.is_finite() && extent.min_element() > 0.0,
            "of an extent above 0 on each axis",
        )?;
        let valid = self.error_rates.is_sound();
        check(
            "error_rates",
            &self.error_rates,
            valid,
            "increasing budgets with finite, non-increasing rates of at least 0",
        )?;
        let valid = self.work_prices.is_sound();
        check(
            "work_prices",
            &self.work_prices,
            valid,
            "as many kinds as prices, all finite and at least 0",
        )?;
        check(
            "work_prices.shared",
            &self.work_prices.shared,
            self.work_prices.shared.is_sound(&self.knobs),
            "at most four of the map's knobs, with a finite energy of at least 0 for each combination of levels",
        )?;
        check(
            "knob_effects",
            &self.knob_effects,
            self.knob_effects.is_sound(&self.knobs),
            "a finite energy of at least 0 and an error from 0 to 2 for each level of each knob",
        )?;
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

fn check(
    field: &'static str,
    value: impl std::fmt::Debug,
    holds: bool,
    expected: &'static str,
) -> Result<(), FrontierMapError> {
    if holds {
        Ok(())
    } else {
        Err(FrontierMapError::OutOfRange { field, value: format!("{value:?}"), expected })
    }
}

//! One line of the log.

use bevy_frugal_gi::control::{ControlStatus, Outcome};
use serde::{Deserialize, Serialize};

use crate::row_log::Row;

/// What the controller did with one camera at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ControlSample {
    /// Seconds of real time since the app started; finite, at least 0.
    pub time_s: f64,
    /// Number of the camera in this run.
    pub camera: u32,
    /// The status, in a word; with the reason where the controller is off.
    pub status: String,
    /// The limit that keeps the settings from being better; empty where none does.
    pub held_by: String,
    /// The camera's own limit of power, watts; finite, as are all the following. `None`: none.
    pub power_budget_w: Option<f64>,
    /// Limit of the whole app, watts. `None`: none.
    pub app_budget_w: Option<f64>,
    /// Predicted power of the applied settings, in the watts of the app's meter.
    pub predicted_w: Option<f64>,
    /// The meter's reading of the whole app, watts. `None` while unknown, and for a reading that an
    /// earlier sample has.
    pub metered_w: Option<f64>,
    /// The meter: its name, and whether it measures or models. Empty without a meter.
    pub meter: String,
    /// Limit of the error, 1 − SSIM. `None`: none.
    pub error_budget: Option<f64>,
    /// Predicted error of the applied settings, 1 − SSIM.
    pub predicted_error: Option<f64>,
    /// What the camera's [`ErrorMeter`](bevy_frugal_gi::error_meter::ErrorMeter) measured since the last sample,
    /// 1 − SSIM. `None` where it measured nothing since, and without one.
    pub measured_error: Option<f64>,
    /// Mean duration of the frames since the last sample, milliseconds.
    pub frame_ms: Option<f64>,
    /// The longest of them, milliseconds.
    pub longest_frame_ms: Option<f64>,
    /// Number of changes of the settings since the last sample.
    pub switches: u32,
    /// Every knob with its level: `gi_vpl_count=1024 gi_interleave=4x4`.
    pub settings: String,
}

impl Row for ControlSample {
    const PLUGIN: &'static str = "ControlLogPlugin";

    fn validated(self) -> Result<Self, String> {
        for (field, value) in [
            ("time_s", Some(self.time_s)),
            ("power_budget_w", self.power_budget_w),
            ("app_budget_w", self.app_budget_w),
            ("predicted_w", self.predicted_w),
            ("metered_w", self.metered_w),
            ("error_budget", self.error_budget),
            ("predicted_error", self.predicted_error),
            ("measured_error", self.measured_error),
            ("frame_ms", self.frame_ms),
            ("longest_frame_ms", self.longest_frame_ms),
        ] {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                return Err(format!("`{field}` is {value}, which must be finite"));
            }
        }
        Ok(self)
    }
}

/// The status in a word, as the log has it.
pub(super) fn status(status: ControlStatus) -> String {
    match status {
        ControlStatus::Waiting => "waiting".to_owned(),
        ControlStatus::Active(Outcome::Met) => "met".to_owned(),
        ControlStatus::Active(Outcome::Settling) => "settling".to_owned(),
        ControlStatus::Active(Outcome::PowerCannotBeMet) => "power-not-met".to_owned(),
        ControlStatus::Active(Outcome::ErrorCannotBeMet) => "error-not-met".to_owned(),
        ControlStatus::Active(Outcome::LimitedByPower) => "limited-by-power".to_owned(),
        ControlStatus::Off(reason) => format!("off {reason:?}"),
        status => format!("{status:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row_log::{read_rows, rows_to_text};

    fn samples() -> [ControlSample; 2] {
        let full = ControlSample {
            time_s: 1.25,
            camera: 3,
            status: "met".into(),
            held_by: "Power".into(),
            power_budget_w: Some(7.5),
            app_budget_w: Some(12.0),
            predicted_w: Some(7.1),
            metered_w: Some(0.1 + 0.2),
            meter: "a \"fine\" meter, modelled".into(),
            error_budget: Some(0.02),
            predicted_error: Some(1e-300),
            measured_error: Some(0.021),
            frame_ms: Some(16.6),
            longest_frame_ms: Some(33.3),
            switches: 2,
            settings: "gi_vpl_count=1,024 fog=\"thick\"".into(),
        };
        [full, ControlSample::default()]
    }

    #[test]
    fn the_format_is_the_documented_one() {
        let text = rows_to_text(&samples());
        let columns = "time_s,camera,status,held_by,power_budget_w,app_budget_w,predicted_w,metered_w,\
                       meter,error_budget,predicted_error,measured_error,frame_ms,longest_frame_ms,\
                       switches,settings";
        assert_eq!(text.lines().next(), Some(columns));
        assert_eq!(read_rows(&text), Ok(samples().to_vec()));
    }

    #[test]
    fn a_faulty_line_is_named() {
        let text = rows_to_text(&samples());
        for (from, to, expected) in [
            ("time_s", "times", "line 1: `times,camera"),
            ("7.5", "seven", "line 2: `power_budget_w` is `seven`"),
            ("7.1", "inf", "line 2: `predicted_w` is inf, which must be finite"),
            ("1.25,3", "1.25,-3", "line 2: `camera` is `-3`"),
            ("1.25,3,met", "1.25,3", "line 2: 15 fields instead of 16"),
        ] {
            let read = read_rows::<ControlSample>(&text.replacen(from, to, 1));
            let message = read.expect_err(to).to_string();
            assert!(message.starts_with(expected), "{message}");
        }
    }
}

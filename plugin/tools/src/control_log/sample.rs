//! One line of the log.

use bevy_frugal_gi::control::{ControlStatus, Outcome};

/// What the controller did with one camera at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
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

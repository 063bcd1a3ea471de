//! Writes what the controller does to a CSV file: budgets, predicted and metered power, error,
//! settings and frame times, a few times a second.
//!
//! [`ControlLogPlugin`] writes the file, spreadsheets open it, and `frugal plot-log FILE` plots it. The
//! plugin is not part of [`FrugalGiPlugins`](crate::FrugalGiPlugins): add it to the builds whose
//! budgets you want to look at.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins, ControlLogPlugin::new("control.csv")))
//!     .run();
//! ```
//!
//! # The file
//!
//! The first line names the columns; each further line is one camera at one moment. Lines are only
//! appended, so that a crash loses at most the last one. A later run appends to the file, and its
//! clock restarts at 0. An empty field is unknown, or not there.
//!
//! | column | meaning |
//! |---|---|
//! | `time_s` | seconds of real time since the app started |
//! | `camera` | number of the camera in this run, in the order in which cameras appear |
//! | `status` | `waiting`, `met`, `settling`, `power-not-met`, `error-not-met`, `limited-by-power`, or `off` with the reason |
//! | `held_by` | the limit that keeps the settings from being better |
//! | `power_budget_w`, `app_budget_w` | the camera's own limit of power, and that of the whole app, watts |
//! | `predicted_w` | predicted power of the applied settings, corrected by the meter, watts |
//! | `metered_w` | the meter's reading of the whole app, watts, once for every reading |
//! | `meter` | name of the meter, and whether it measures or models |
//! | `error_budget`, `predicted_error` | 1 − SSIM |
//! | `measured_error` | what an [`ErrorMeter`](crate::error_meter::ErrorMeter) measured, once for every measurement, 1 − SSIM |
//! | `frame_ms`, `longest_frame_ms` | mean and longest frame since the line before, milliseconds |
//! | `switches` | number of changes of this camera's settings since the line before |
//! | `settings` | every knob with its level |
//!
//! [`parse`] and [`to_text`] depend on neither an app nor a renderer.
mod error;
mod file;
mod plugin;
mod sample;
mod writer;

pub use error::ControlLogError;
pub use file::{COLUMNS, parse, to_text};
pub use plugin::{ControlLogPlugin, ControlLogSystems};
pub use sample::ControlSample;

//! Measures the error of a camera's frames in the running app: now and then a hidden camera renders
//! a part of the same view at the best settings, and the GPU compares both images.
//!
//! | file | world | job |
//! |---|---|---|
//! | `probe` | main | the hidden camera: when, where, and with which settings |
//! | `compare`, `compare.wgsl` | render | the part of the image that is compared, and its 1 − SSIM |
//!
//! The error is that of `frugal`'s maps: 1 − SSIM (Wang et al. 2004) against the best settings.
//! [`ErrorFeedback`](crate::control::ErrorFeedback) corrects the map's predictions by the
//! measurements. Error budgets then hold in views that the map does not know, and easier views do
//! not waste them.

mod compare;
mod probe;

use std::time::Duration;

use bevy::asset::embedded_asset;
use bevy::camera::CameraUpdateSystems;
use bevy::prelude::*;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use frugal_core::control::{MEASUREMENT_PERIOD, measurement_interval};

use crate::schedule::KnobSystems;

/// Marks the hidden camera that renders a part of another camera's view at the best settings. It
/// exists during a measurement, with the authored values of all components that Bevy's rendering
/// reads. An app with rendering components of its own adds them by an observer of this one's
/// insertion.
#[derive(Component, ExtractComponent, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorProbe {
    /// The camera whose error is measured.
    pub camera: Entity,
}

/// Measures the error of this camera's frames. Needs [`KnobSettings`](crate::knobs::KnobSettings),
/// which the controller gives its cameras.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
#[require(MeasuredError, probe::MeterState)]
pub struct ErrorMeter {
    /// Mean time between measurements, ½ to 1½ times of which pass in turns. Lower values follow views
    /// faster; higher values cost less: a measurement renders [`frames`](Self::frames) frames of its part
    /// at the best settings. Default: 20 s.
    pub period: Duration,
    /// Share of the image's width and height that is measured, 0 to 1; NaN counts as 1. Each
    /// measurement takes another part. Higher values vary less; lower values cost less. Default: ¼.
    ///
    /// The part has exactly the image's aspect ratio: its size is rounded down accordingly, but not
    /// below the smallest such size (half of 1366 × 768). All of the image is measured where an
    /// effect needs it, such as bloom, depth of field, or automatic exposure.
    pub share: f32,
    /// Frames that the hidden camera renders before it is compared, at least 2, and at least 16
    /// with temporal antialiasing. Higher values: a longer history, so less noise in the reference.
    /// Lower values: cheaper, but the reference's noise adds to the measured error. Default: 4.
    pub frames: u32,
}

impl Default for ErrorMeter {
    fn default() -> Self {
        Self { period: MEASUREMENT_PERIOD, share: 0.25, frames: 4 }
    }
}

impl ErrorMeter {
    /// Time from measurement number `count` to the next: see [`measurement_interval`].
    pub fn interval(&self, count: u32) -> Duration {
        measurement_interval(self.period, count)
    }
}

/// What an [`ErrorMeter`] has measured.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct MeasuredError {
    /// 1 − SSIM of the last measurement, 0 to 2; `None` before the first.
    pub last: Option<f64>,
    /// Number of measurements.
    pub count: u32,
}

/// Adds [`ErrorMeter`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ErrorMeterPlugin;

impl Plugin for ErrorMeterPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "compare.wgsl");
        app.register_type::<ErrorMeter>()
            .register_type::<MeasuredError>()
            .add_plugins((
                ExtractComponentPlugin::<ErrorProbe>::default(),
                ExtractComponentPlugin::<compare::Comparison>::default(),
            ))
            .add_observer(probe::stop)
            .add_systems(
                PostUpdate,
                // The probe is spawned in time for its settings, its lights' maps and its size.
                probe::drive
                    .before(KnobSystems::Apply)
                    .before(CameraUpdateSystems)
                    .run_if(any_with_component::<ErrorMeter>),
            );
    }

    fn finish(&self, app: &mut App) {
        crate::atmosphere::share_atmosphere(app);
        compare::finish(app);
    }
}

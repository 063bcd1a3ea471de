//! Records an app's camera paths to a file, so that settings can be trained on the views that
//! occur.
//!
//! [`CameraRecorderPlugin`] writes the file, and `frugal precompute --cameras FILE` reads it. Add
//! it to the builds that are used for recording.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//! use bevy_frugal_gi_tools::{CameraRecorderPlugin, RecordCamera};
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins, CameraRecorderPlugin::new("cameras.txt")))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Camera3d::default(), FrugalGi::default(), RecordCamera));
//!     })
//!     .run();
//! ```
//!
//! # The file
//!
//! Text, in lines that are only appended, so that a crash loses at most the last one. The first
//! line is the name and version of the format, the second the names of the columns, and each
//! further line a [`CameraSample`]:
//!
//! ```text
//! frugal-cameras 1
//! time_s,camera,x_m,y_m,z_m,qx,qy,qz,qw,vertical_fov_rad,aspect
//! 0.25,0,0.0,1.7,6.0,0.0,0.0,0.0,1.0,1.0471976,1.7777778
//! ```
//!
//! A later run of the app appends to the file. Its clock restarts at 0 and its cameras get new
//! numbers: lines with the same number are one camera in one run, in order of time. A static camera
//! adds no lines.

mod sample;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::camera::CameraUpdateSystems;
use bevy::prelude::*;
use bevy_frugal_gi::frontier::{CameraView, camera_view};

use crate::row_log::{Row, RowLog, RowLogError, is_on_stage, read_rows};
pub use sample::CameraSample;

/// Marks a camera whose path [`CameraRecorderPlugin`] records. An inactive camera is not recorded.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct RecordCamera;

/// Records the paths of cameras with [`RecordCamera`] to a file: see [the module](self).
///
/// Appends to an existing recording, and never changes another existing file. Only one app may
/// write a recording at a time. Needs Bevy's `TimePlugin`.
///
/// File errors do not affect the app: frames never wait for the disk, and if the file cannot be
/// written, the recorder logs one error with the remedy and turns off. In a browser, which has no
/// files, it is always off; so is it on the stage of `frugal`.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraRecorderPlugin {
    /// Path of the file. Missing parent folders are created.
    pub path: PathBuf,
    /// Interval between samples of the cameras, in real time. Higher values give a smaller file and
    /// a coarser path; lower values a larger file; 0 samples every frame. Default: 0.25 s.
    pub interval: Duration,
    /// Minimum motion since the camera's last recorded sample, metres; less motion records nothing
    /// unless the camera rotated. Higher values give a smaller file and a coarser path. 0, negative
    /// values and NaN record every sample. Default: 0.05 m.
    pub min_distance: f32,
    /// Minimum rotation, or change of the field of view, since the last recorded sample, radians;
    /// higher values give a smaller file and a coarser path. 0, negative values and NaN record
    /// every sample. Default: 2 degrees.
    pub min_angle: f32,
    /// Maximum number of samples in the file, with those of earlier runs; recording then ends with
    /// a warning. Higher values allow longer recordings and larger files. Default: 100,000, about
    /// 10 MB, or seven hours of a constantly moving camera.
    pub max_samples: usize,
}

impl CameraRecorderPlugin {
    /// Records to the file at `path`, with the default settings.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            interval: Duration::from_millis(250),
            min_distance: 0.05,
            min_angle: 2_f32.to_radians(),
            max_samples: 100_000,
        }
    }
}

/// State of the running recorder, read-only for the app. Absent in a browser, and before `Startup`.
#[derive(Resource)]
pub struct CameraRecorder {
    settings: CameraRecorderPlugin,
    log: Option<RowLog<CameraSample>>,
    tracks: HashMap<Entity, Track>,
    next_camera: u32,
    next_sample: Duration,
    samples: usize,
    warned_of_numbers: bool,
}

/// Recording state of one camera.
struct Track {
    camera: u32,
    last: Option<CameraSample>,
}

impl CameraRecorder {
    /// Number of samples of this run that were queued for the file.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Whether samples are recorded. False once the file is full or cannot be written.
    pub fn is_recording(&self) -> bool {
        self.log.as_ref().is_some_and(RowLog::is_running)
    }

    fn sample(&mut self, camera: Entity, time: Duration, view: &CameraView) {
        let Some(log) = &mut self.log else { return };
        let track = self.tracks.entry(camera).or_insert_with(|| {
            let camera = self.next_camera;
            self.next_camera = camera.saturating_add(1);
            Track { camera, last: None }
        });
        // Milliseconds suffice, and are easier to read.
        let time_s = (time.as_secs_f64() * 1e3).round() / 1e3;
        let sample = match CameraSample::new(time_s, track.camera, view).validated() {
            Ok(sample) => sample,
            Err(number) => {
                if !std::mem::replace(&mut self.warned_of_numbers, true) {
                    warn!("camera {camera} is not recorded while its {number}");
                }
                return;
            }
        };
        let CameraRecorderPlugin { min_distance, min_angle, .. } = self.settings;
        if track.last.is_some_and(|last| !sample.differs(&last, min_distance, min_angle)) {
            return;
        }
        if log.push(sample) {
            track.last = Some(sample);
            self.samples += 1;
        }
    }
}

impl Drop for CameraRecorder {
    fn drop(&mut self) {
        if self.is_recording() && self.samples == 0 {
            let file = self.settings.path.display();
            warn!("no camera was recorded into {file}: put RecordCamera on an active one");
        }
    }
}

impl Plugin for CameraRecorderPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<RecordCamera>();
        // A browser has neither files nor threads.
        if cfg!(target_family = "wasm") {
            warn!("cameras are not recorded: a browser has no files");
            return;
        }
        let settings = self.clone();
        let start = move |mut commands: Commands| start(&mut commands, &settings);
        let sample = sample_cameras
            // Needs this frame's projections and camera transforms.
            .after(CameraUpdateSystems)
            .after(TransformSystems::Propagate)
            .run_if(resource_exists::<CameraRecorder>);
        app.add_systems(Startup, start.run_if(resource_exists::<Time<Real>>))
            .add_systems(PostUpdate, sample);
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Time<Real>>() {
            warn!("CameraRecorderPlugin stays off: this app has no clock, add TimePlugin");
        }
    }
}

/// In `Startup`, and not when plugins are built: an app that never runs changes no file.
fn start(commands: &mut Commands, settings: &CameraRecorderPlugin) {
    let path = &settings.path;
    let earlier = earlier_samples(path);
    if let Err(error) = &earlier {
        error!(
            "{} is not written: {error}, or name another file, or move this one away",
            path.display()
        );
    }
    // The tool moves cameras where nobody plays.
    let log = earlier
        .as_ref()
        .ok()
        .filter(|_| !is_on_stage())
        .map(|earlier| RowLog::start(path, settings.max_samples.saturating_sub(earlier.len())));
    // Numbers of earlier runs' cameras are not reused.
    let numbers = earlier.iter().flatten().map(|sample| sample.camera);
    commands.insert_resource(CameraRecorder {
        settings: settings.clone(),
        log,
        tracks: HashMap::new(),
        next_camera: numbers.max().map_or(0, |number| number.saturating_add(1)),
        next_sample: Duration::ZERO,
        samples: 0,
        warned_of_numbers: false,
    });
}

/// The samples of earlier runs. None where there is no recording: the log says what is in its way.
fn earlier_samples(path: &Path) -> Result<Vec<CameraSample>, RowLogError> {
    // Not a device, which may have no end.
    let is_file = std::fs::metadata(path).is_ok_and(|found| found.is_file());
    let bytes = if is_file { std::fs::read(path).unwrap_or_default() } else { Vec::new() };
    if bytes.is_empty() { Ok(Vec::new()) } else { read_rows(&String::from_utf8_lossy(&bytes)) }
}

fn sample_cameras(
    time: Res<Time<Real>>,
    mut recorder: ResMut<CameraRecorder>,
    cameras: Query<(Entity, &Camera, &GlobalTransform, Option<&Projection>), With<RecordCamera>>,
) {
    let now = time.elapsed();
    if !recorder.is_recording() || now < recorder.next_sample {
        return;
    }
    recorder.next_sample = now.saturating_add(recorder.settings.interval);
    recorder.tracks.retain(|camera, _| cameras.contains(*camera));
    for (entity, camera, transform, projection) in &cameras {
        if camera.is_active {
            recorder.sample(entity, now, &camera_view(transform, projection));
        }
    }
}

#[cfg(test)]
#[path = "recorder_tests.rs"]
mod tests;

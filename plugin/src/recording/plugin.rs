//! The recorder in a Bevy app: samples the cameras that are marked, and hands what moved to the
//! writer.

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Duration;

use bevy::camera::{Camera, CameraUpdateSystems, Projection};
use bevy::ecs::schedule::common_conditions::resource_exists;
use bevy::prelude::*;
use bevy::time::Real;
use bevy::transform::TransformSystems;

use super::CameraSample;
use super::writer::{CameraWriter, Sent};
use crate::frontier::CameraView;

/// Put it on a camera whose way [`CameraRecorderPlugin`] is to record. While the camera is inactive
/// nothing is.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct RecordCamera;

/// Records where cameras with [`RecordCamera`] go into a file: see [the module](super).
///
/// A file that is there already is appended to where it is a recording, and left alone where it is
/// not. One app may write it at a time. Needs Bevy's `TimePlugin`.
///
/// Nothing that happens to the file disturbs the app: frames do not wait for the disk, and where
/// the file cannot be written, one error says why and what to do, and the recorder stays off. In a
/// browser, which has no files, it does from the start.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraRecorderPlugin {
    /// The file. Folders on the way to it are made.
    pub path: PathBuf,
    /// Time between two looks at the cameras, by the wall clock. 0.25 s by default; 0 is every
    /// frame.
    pub interval: Duration,
    /// Motion since the camera's last sample, metres, below which nothing is written unless the
    /// camera turned. 0.05 by default: the more, the smaller the file. 0 and less, and what is no
    /// number, write every look.
    pub min_distance: f32,
    /// The same of turns and of changes of the field of view, radians. 2 degrees by default.
    pub min_angle: f32,
    /// Samples that the file may hold, earlier runs' included; recording ends there, with a
    /// warning. 100,000 by default: about 10 MB, or seven hours of a camera that never rests.
    pub max_samples: usize,
}

impl CameraRecorderPlugin {
    /// Into the file at `path`, at the defaults.
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

/// When cameras are recorded.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RecordingSystems {
    /// Part of `PostUpdate`, after cameras are updated and transforms propagated.
    Sample,
}

/// The recorder at work, to be read. There is none in a browser.
#[derive(Resource)]
pub struct CameraRecorder {
    settings: CameraRecorderPlugin,
    writer: Option<CameraWriter>,
    tracks: HashMap<Entity, Track>,
    next_camera: u32,
    next_look: Duration,
    samples: usize,
    warned_of_disk: bool,
    warned_of_numbers: bool,
}

/// What was recorded of one camera.
struct Track {
    camera: u32,
    last: Option<CameraSample>,
}

impl CameraRecorder {
    /// Samples of this run that were handed to the file.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Whether samples are taken. No longer once the file is full or cannot be written.
    pub fn is_recording(&self) -> bool {
        self.writer.as_ref().is_some_and(CameraWriter::is_running)
    }

    fn look(&mut self, camera: Entity, time: Duration, view: CameraView) {
        let Some(writer) = &self.writer else { return };
        let track = self.tracks.entry(camera).or_insert_with(|| {
            let camera = self.next_camera;
            self.next_camera = camera.saturating_add(1);
            Track { camera, last: None }
        });
        let CameraView { position, rotation, vertical_fov, aspect } = view;
        // Milliseconds will do, and are easier to read.
        let time_s = (time.as_secs_f64() * 1e3).round() / 1e3;
        let sample =
            CameraSample { time_s, camera: track.camera, position, rotation, vertical_fov, aspect };
        let sample = match sample.validated() {
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
        match writer.send(sample) {
            Sent::Queued => {
                track.last = Some(sample);
                self.samples += 1;
            }
            Sent::LeftOut => {
                if !std::mem::replace(&mut self.warned_of_disk, true) {
                    warn!(
                        "{} lacks some cameras: the disk is too slow",
                        self.settings.path.display()
                    );
                }
            }
            Sent::Stopped => self.writer = None,
        }
    }
}

impl Drop for CameraRecorder {
    fn drop(&mut self) {
        if self.writer.is_some() && self.samples == 0 {
            let file = self.settings.path.display();
            warn!("no camera was recorded into {file}: put RecordCamera on an active one");
        }
    }
}

impl Plugin for CameraRecorderPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<RecordCamera>();
        // It has neither files nor threads.
        if cfg!(target_family = "wasm") {
            warn!("cameras are not recorded: a browser has no files");
            return;
        }
        let settings = self.clone();
        let start = move |mut commands: Commands| start(&mut commands, &settings);
        let sample = sample_cameras
            .in_set(RecordingSystems::Sample)
            // Need this frame's picture and where cameras are in it.
            .after(CameraUpdateSystems)
            .after(TransformSystems::Propagate)
            .run_if(resource_exists::<CameraRecorder>);
        app.add_systems(Startup, start.run_if(resource_exists::<Time<Real>>))
            .add_systems(PostUpdate, sample);
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Time<Real>>() {
            warn!("CameraRecorderPlugin stays off: it has no clock, add TimePlugin");
        }
    }
}

/// In `Startup`, and not when plugins are built: an app that never runs touches no file.
fn start(commands: &mut Commands, settings: &CameraRecorderPlugin) {
    let writer = CameraWriter::start(settings.path.clone(), settings.max_samples);
    if let Err(error) = &writer {
        error!(
            "cameras are not recorded into {}: no thread to write with: {error}",
            settings.path.display()
        );
    }
    commands.insert_resource(CameraRecorder {
        settings: settings.clone(),
        writer: writer.ok(),
        tracks: HashMap::new(),
        next_camera: 0,
        next_look: Duration::ZERO,
        samples: 0,
        warned_of_disk: false,
        warned_of_numbers: false,
    });
}

fn sample_cameras(
    time: Res<Time<Real>>,
    mut recorder: ResMut<CameraRecorder>,
    cameras: Query<(Entity, &Camera, &GlobalTransform, Option<&Projection>), With<RecordCamera>>,
) {
    let now = time.elapsed();
    if recorder.writer.is_none() || now < recorder.next_look {
        return;
    }
    recorder.next_look = now.saturating_add(recorder.settings.interval);
    recorder.tracks.retain(|camera, _| cameras.contains(*camera));
    for (entity, camera, transform, projection) in &cameras {
        if camera.is_active {
            recorder.look(entity, now, CameraView::from_camera(transform, projection));
        }
    }
}

#[cfg(test)]
#[path = "plugin_tests.rs"]
mod tests;

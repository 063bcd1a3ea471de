//! Recordings of an app's cameras, as tracks.

use std::path::{Path, PathBuf};

use bevy_frugal_gi::recording::{CameraFileError, CameraSample, parse};

use super::TrackSample;
use super::set::sample;
use crate::scene::CameraPose;

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum RecordedError {
    /// The file cannot be read.
    #[error("{path}: cannot be read: {source}; give a file that the plugin's recorder wrote", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file is not a recording.
    #[error("{path}: {source}", path = path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Line, field and remedy.
        source: CameraFileError,
    },
    /// The recording has no samples.
    #[error("{path}: no camera was recorded; let the app run for a while with the recorder", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// The tracks in a recording, one for each camera.
///
/// # Errors
/// When the file cannot be read, is no recording, or is empty.
pub(crate) fn recorded(path: &Path) -> Result<Vec<Vec<TrackSample>>, RecordedError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| RecordedError::File { path: path.to_owned(), source })?;
    let samples =
        parse(&text).map_err(|source| RecordedError::Content { path: path.to_owned(), source })?;
    let tracks = tracks(&samples);
    if tracks.is_empty() { Err(RecordedError::Empty { path: path.to_owned() }) } else { Ok(tracks) }
}

fn tracks(samples: &[CameraSample]) -> Vec<Vec<TrackSample>> {
    let mut cameras: Vec<u32> = samples.iter().map(|sample| sample.camera).collect();
    cameras.sort_unstable();
    cameras.dedup();
    let pose =
        |sample: &CameraSample| CameraPose { position: sample.position, rotation: sample.rotation };
    let track = |camera: u32| {
        let own: Vec<&CameraSample> =
            samples.iter().filter(|sample| sample.camera == camera).collect();
        let moved = (0..own.len()).map(|index| {
            let (from, to) = (own[index.saturating_sub(1)], own[index]);
            // Speed is undefined where times do not increase.
            let seconds = (to.time_s - from.time_s) as f32;
            if seconds > 1e-3 {
                sample(pose(from), pose(to), seconds)
            } else {
                sample(pose(to), pose(to), 1.0)
            }
        });
        moved.collect()
    };
    cameras.into_iter().map(track).collect()
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::recording::to_text;
    use glam::{Quat, Vec3};

    use super::*;

    #[test]
    fn a_recording_is_a_track_for_each_camera() {
        let sample = |time_s: f64, camera: u32, x: f32| CameraSample {
            time_s,
            camera,
            position: Vec3::new(x, 1.6, 0.0),
            rotation: Quat::IDENTITY,
            vertical_fov: 1.0,
            aspect: 1.5,
        };
        let samples =
            [sample(0.0, 0, 0.0), sample(0.0, 1, 9.0), sample(0.5, 0, 1.0), sample(0.5, 0, 2.0)];
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cameras.txt");
        std::fs::write(&file, to_text(&samples)).expect("room");
        let tracks = recorded(&file).expect("a recording");
        assert_eq!(tracks.iter().map(Vec::len).collect::<Vec<_>>(), [3, 1]);
        assert_eq!((tracks[0][1].velocity, tracks[0][2].velocity), (Vec3::X * 2.0, Vec3::ZERO));
        std::fs::write(&file, to_text(&[])).expect("room");
        assert!(matches!(recorded(&file), Err(RecordedError::Empty { .. })));
        std::fs::write(&file, "no recording\n").expect("room");
        assert!(recorded(&file).expect_err("refused").to_string().contains("cameras.txt"));
        assert!(matches!(recorded(&folder.path().join("none")), Err(RecordedError::File { .. })));
    }
}

//! Tracks of cameras: the scene's paths, and recordings of an app.
//!
//! The recorder writes a sample when a camera has moved, at most every 0.25 s. A track has a sample for
//! each frame, so that its stretches play at the app's speed and every second of it weighs alike.

use std::collections::BTreeSet;
use std::path::Path;

use bevy_frugal_gi_tools::recording::CameraSample;
use bevy_frugal_gi_tools::row_log::read_rows;
use frugal_core::frontier::CameraView;
use frugal_search::cameras::{TrackSample, sampled};
use frugal_trace::scene::{Bounds, CameraPose};
use glam::Vec3;

use crate::scene::{CameraPath, LoadedScene};

/// Longest time in which a camera counts as still, seconds. Beyond it the app was paused, or nobody
/// played.
const LONGEST_STILL: f64 = 60.0;
/// A camera that moved by less since its last sample, metres and radians, may have done so slowly: the
/// recorder leaves out half of it.
const SLOW: (f32, f32) = (0.1, 0.07);

/// How far beside the tracks cameras may be: a share of the tracks' extent, and at least so many metres.
/// Higher values: more cameras where no player was, in coarser nodes.
const BESIDE_TRACKS: (f32, f32) = (0.25, 4.0);

/// Samples of `paths` at `frames_per_second`.
pub(crate) fn tracks_of<'a>(
    paths: impl IntoIterator<Item = &'a CameraPath>,
    frames_per_second: f64,
) -> Vec<Vec<TrackSample>> {
    let track = |path: &CameraPath| {
        sampled(path.duration().into(), frames_per_second, |seconds| {
            path.sample(path.start() + seconds as f32)
        })
    };
    paths.into_iter().map(track).filter(|track: &Vec<_>| !track.is_empty()).collect()
}

/// Where cameras may be: the scene's own bounds, else those of its geometry, of which only the
/// surroundings of `tracks` count where there are any.
pub(crate) fn camera_space(scene: &LoadedScene, tracks: &[Vec<TrackSample>]) -> Bounds {
    let own = scene.camera_bounds();
    if scene.bounds.is_some() {
        return own;
    }
    reach_of(own, tracks.iter().flatten().map(|sample| sample.pose.position))
}

/// The part of `all` that cameras at `places` reach. A skyline or a sea would take most of an octree's
/// nodes.
fn reach_of(all: Bounds, places: impl IntoIterator<Item = Vec3>) -> Bounds {
    let Some(seen) = Bounds::around(places) else { return all };
    let margin = (BESIDE_TRACKS.0 * seen.size().max_element()).max(BESIDE_TRACKS.1);
    Bounds {
        min: (seen.min - margin).max(all.min.min(seen.min)),
        max: (seen.max + margin).min(all.max.max(seen.max)),
    }
}

/// The tracks in a recording, one for each camera, with a sample for each frame.
///
/// # Errors
/// In a sentence: the file cannot be read, is no recording, or is empty.
pub(crate) fn recorded_tracks(
    path: &Path,
    frames_per_second: f64,
) -> Result<Vec<Vec<TrackSample>>, String> {
    let file = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| {
        format!("{file}: cannot be read: {error}; give a file that the plugin's recorder wrote")
    })?;
    let samples: Vec<CameraSample> =
        read_rows(&text).map_err(|error| format!("{file}: {error}"))?;
    let cameras: BTreeSet<u32> = samples.iter().map(|sample| sample.camera).collect();
    let of = |camera: u32| samples.iter().filter(move |sample| sample.camera == camera);
    let own: Vec<Vec<&CameraSample>> =
        cameras.into_iter().map(|camera| of(camera).collect()).collect();
    let gaps = own.iter().flat_map(|own| own.windows(2).map(|two| two[1].time_s - two[0].time_s));
    // A camera that stood still was sampled again an interval after it began to move.
    let interval = gaps.filter(|gap| *gap > 1e-3).fold(LONGEST_STILL, f64::min);
    let track = |own: &Vec<&CameraSample>| {
        let keys = keys(own, interval);
        let end = keys.last().map_or(0.0, |key| key.0);
        sampled(end, frames_per_second, |seconds| Some(pose_at(&keys, seconds)))
    };
    let tracks: Vec<Vec<TrackSample>> = own.iter().map(track).collect();
    if tracks.is_empty() {
        return Err(format!(
            "{file}: no camera was recorded; let the app run for a while with the recorder"
        ));
    }
    Ok(tracks)
}

/// A camera's poses by the time since its first one, between which it moves evenly. A cut is two poses
/// at one time. `interval`: seconds between samples of a camera in motion.
fn keys(samples: &[&CameraSample], interval: f64) -> Vec<(f64, CameraPose)> {
    let pose = |sample: &CameraSample| {
        let CameraView { position, rotation, .. } = sample.view();
        CameraPose { position, rotation }
    };
    let mut now = 0.0;
    let mut keys: Vec<(f64, CameraPose)> =
        samples.iter().take(1).map(|it| (0.0, pose(it))).collect();
    for two in samples.windows(2) {
        let (from, to) = (pose(two[0]), pose(two[1]));
        let gap = (two[1].time_s - two[0].time_s).clamp(0.0, LONGEST_STILL);
        let is_slow = from.position.distance(to.position) < SLOW.0
            && from.rotation.angle_between(to.rotation) < SLOW.1;
        let moving = if is_slow || gap < 2.0 * interval { gap } else { interval };
        if moving < gap {
            keys.push((now + gap - moving, from));
        }
        now += gap;
        if moving <= 1e-3 || TrackSample::between(from, to, moving as f32).is_cut(from) {
            keys.push((now, from));
        }
        keys.push((now, to));
    }
    keys
}

/// The pose at a time within `keys`, which are not empty.
fn pose_at(keys: &[(f64, CameraPose)], seconds: f64) -> CameraPose {
    let next = keys.partition_point(|key| key.0 <= seconds);
    let (start, from) = keys[next.saturating_sub(1)];
    let Some((end, to)) = keys.get(next).filter(|next| next.1 != from) else { return from };
    let share = ((seconds - start) / (end - start)).clamp(0.0, 1.0) as f32;
    CameraPose {
        position: from.position.lerp(to.position, share),
        rotation: from.rotation.slerp(to.rotation, share),
    }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi_tools::row_log::rows_to_text;
    use glam::Quat;

    use super::*;

    #[test]
    fn a_sea_around_a_harbour_is_out_of_reach() {
        let sea =
            Bounds { min: Vec3::new(-257.0, -2.0, -200.0), max: Vec3::new(247.0, 60.0, 200.0) };
        let walk = [Vec3::new(-8.0, 1.6, -4.0), Vec3::new(12.0, 18.0, 6.0)];
        let reach = reach_of(sea, walk);
        assert_eq!(
            (reach.min, reach.max),
            (Vec3::new(-13.0, -2.0, -9.0), Vec3::new(17.0, 23.0, 11.0))
        );
        // A camera that looks at a small thing from outside is in reach; without any, all is.
        let thing = Bounds { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
        let eye = Vec3::new(0.0, 0.0, 6.0);
        assert_eq!(reach_of(thing, [eye]).max, Vec3::new(1.0, 1.0, 6.0));
        assert_eq!(reach_of(thing, []), thing);
    }

    /// A sample at a place along x.
    fn sample(time_s: f64, camera: u32, x: f32) -> CameraSample {
        let (position, rotation) = (Vec3::new(x, 1.6, 0.0), Quat::IDENTITY);
        let view = CameraView { position, rotation, vertical_fov: 1.0, aspect: 1.5 };
        CameraSample::new(time_s, camera, &view)
    }

    #[test]
    fn a_recording_is_a_track_for_each_camera() {
        let samples =
            [sample(0.0, 0, 0.0), sample(0.0, 1, 9.0), sample(0.5, 0, 1.0), sample(0.5, 0, 9.0)];
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cameras.txt");
        std::fs::write(&file, rows_to_text(&samples)).expect("room");
        let tracks = recorded_tracks(&file, 10.0).expect("a recording");
        assert_eq!(tracks.iter().map(Vec::len).collect::<Vec<_>>(), [5, 1]);
        assert!((tracks[0][4].pose.position.x - 0.8).abs() < 1e-6, "{tracks:?}");
        assert!((tracks[0][4].velocity - Vec3::X * 2.0).length() < 1e-5, "{tracks:?}");
        std::fs::write(&file, rows_to_text::<CameraSample>(&[])).expect("room");
        assert!(recorded_tracks(&file, 10.0).expect_err("empty").contains("no camera"));
        std::fs::write(&file, "no recording\n").expect("room");
        assert!(recorded_tracks(&file, 10.0).expect_err("refused").contains("cameras.txt"));
        let none = folder.path().join("none");
        assert!(recorded_tracks(&none, 10.0).expect_err("missing").contains("cannot be read"));
    }

    /// Time, and place along x.
    fn walk(places: &[(f64, f32)], fps: f64) -> Vec<TrackSample> {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("cameras.txt");
        let samples: Vec<CameraSample> =
            places.iter().map(|(time_s, x)| sample(*time_s, 0, *x)).collect();
        std::fs::write(&file, rows_to_text(&samples)).expect("room");
        recorded_tracks(&file, fps).expect("a recording").remove(0)
    }

    #[test]
    fn a_recorded_walk_plays_at_its_speed_whatever_the_frame_rate() {
        // 1.4 m/s, sampled as the recorder does.
        let places: Vec<(f64, f32)> =
            (0..40).map(|step| (0.25 * f64::from(step), 0.35 * step as f32)).collect();
        for fps in [15.0, 30.0, 60.0, 144.0] {
            let track = walk(&places, fps);
            assert_eq!(track.len(), (9.75 * fps).round() as usize, "one sample for each frame");
            let length = track[0].pose.position.distance(track[15].pose.position);
            let expected = 1.4 * 15.0 / fps as f32;
            assert!((length / expected - 1.0).abs() < 1e-3, "{length} m at {fps} fps");
        }
    }

    #[test]
    fn a_camera_that_stands_counts_by_time_and_then_moves_at_its_speed() {
        let mut places = vec![(0.0, 0.0), (0.25, 0.35), (20.25, 0.7), (20.5, 1.05)];
        let track = walk(&places, 20.0);
        assert_eq!(track.len(), 410);
        let still = track.iter().filter(|sample| sample.velocity == Vec3::ZERO).count();
        assert!((390..=397).contains(&still), "{still} of {}", track.len());
        let fastest = track.iter().map(|sample| sample.velocity.x).fold(0.0, f32::max);
        assert!((fastest - 1.4).abs() < 0.01, "{fastest} m/s");
        // A pause of an hour is none of the walk, and a teleport no motion.
        places[2].0 += 3600.0;
        places[3] = (places[2].0 + 0.25, 500.0);
        let track = walk(&places, 20.0);
        assert!((1200..1220).contains(&track.len()), "{}", track.len());
        assert!(track.iter().all(|sample| sample.velocity.x < 1.5), "no frame is between");
        assert!(track.iter().all(|it| it.pose.position.x < 0.8), "{:?}", track.last());
    }

    #[test]
    fn broken_clocks_give_tracks() {
        for places in
            [&[(5.0, 0.0), (5.0, 1.0)][..], &[(5.0, 0.0), (1.0, 1.0), (2.0, 1.5)], &[(1e300, 0.0)]]
        {
            let track = walk(places, 30.0);
            assert!((1..=1801).contains(&track.len()), "{}", track.len());
            assert!(track.iter().all(|it| it.pose.position.is_finite() && it.velocity.is_finite()));
        }
    }
}

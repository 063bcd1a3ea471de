//! Stretches of tracks: what a camera shows in the second before a moment, as in play.

use frugal_trace::scene::CameraPose;
use glam::Vec3;

/// One moment of a track: a path of the scene, or a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackSample {
    /// The camera's pose.
    pub pose: CameraPose,
    /// Metres per second.
    pub velocity: Vec3,
    /// Axis times radians per second.
    pub turn: Vec3,
}

impl TrackSample {
    /// The sample at `to`, `step` seconds after `from`. A jump is a cut, with no motion.
    pub fn between(from: CameraPose, to: CameraPose, step: f32) -> Self {
        let velocity = (to.position - from.position) / step;
        let turn = (to.rotation * from.rotation.inverse()).to_scaled_axis() / step;
        let is_cut = !(velocity.length() < 30.0 && turn.length() < 12.0);
        let [velocity, turn] = if is_cut { [Vec3::ZERO; 2] } else { [velocity, turn] };
        Self { pose: to, velocity, turn }
    }

    /// Whether the camera did not move here `from` another place, but was cut.
    pub fn is_cut(&self, from: CameraPose) -> bool {
        self.pose != from && self.velocity == Vec3::ZERO && self.turn == Vec3::ZERO
    }
}

/// `count` stretches of `frames` poses each, that end evenly over all of `tracks`. Fewer where a
/// track is shorter, or cuts within the stretch.
pub fn stretches(tracks: &[Vec<TrackSample>], count: usize, frames: usize) -> Vec<Vec<CameraPose>> {
    let all: usize = tracks.iter().map(Vec::len).sum();
    let ends = (0..count).map(|index| (2 * index + 1) * all / (2 * count));
    ends.filter_map(|end| {
        let (_, track, end) = locate(tracks, end)?;
        let end = end.max(frames.saturating_sub(1));
        let stretch = track.get((end + 1).checked_sub(frames)?..=end)?;
        let is_whole = stretch.windows(2).all(|two| !two[1].is_cut(two[0].pose));
        is_whole.then(|| stretch.iter().map(|sample| sample.pose).collect())
    })
    .collect()
}

/// Number and samples of the track with sample `of_all` of all tracks' samples, and the sample's
/// index in it.
pub(super) fn locate(
    tracks: &[Vec<TrackSample>],
    of_all: usize,
) -> Option<(usize, &[TrackSample], usize)> {
    let mut index = of_all;
    for (number, track) in tracks.iter().enumerate() {
        if index < track.len() {
            return Some((number, track, index));
        }
        index -= track.len();
    }
    None
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;

    fn track(xs: &[f32]) -> Vec<TrackSample> {
        let pose = |x: f32| CameraPose { position: Vec3::X * x, rotation: Quat::IDENTITY };
        (0..xs.len())
            .map(|index| {
                TrackSample::between(pose(xs[index.saturating_sub(1)]), pose(xs[index]), 0.1)
            })
            .collect()
    }

    fn ends(stretches: &[Vec<CameraPose>]) -> Vec<f32> {
        stretches.iter().filter_map(|poses| Some(poses.last()?.position.x)).collect()
    }

    #[test]
    fn stretches_end_evenly_over_all_tracks() {
        let line: Vec<f32> = (0..20).map(|step| step as f32 * 0.1).collect();
        let other: Vec<f32> = line.iter().map(|x| x + 100.0).collect();
        let found = stretches(&[track(&line), track(&other)], 4, 3);
        assert_eq!(ends(&found), [0.5, 1.5, 100.5, 101.5]);
        assert!(found.iter().all(|poses| poses.len() == 3));
        // The first ends before a whole stretch has passed.
        assert_eq!(stretches(&[track(&line)], 4, 8)[0].len(), 8);
    }

    #[test]
    fn cuts_and_short_tracks_give_none() {
        let cut: Vec<f32> = (0..20).map(|step| if step < 10 { 0.0 } else { 500.0 }).collect();
        assert_eq!(ends(&stretches(&[track(&cut)], 2, 4)), [0.0, 500.0]);
        assert_eq!(ends(&stretches(&[track(&cut)], 2, 8)), [0.0], "the other has the cut in it");
        assert_eq!(stretches(&[track(&cut[..3])], 2, 8).len(), 0);
        assert_eq!((stretches(&[], 2, 8).len(), stretches(&[track(&cut)], 0, 8).len()), (0, 0));
    }
}

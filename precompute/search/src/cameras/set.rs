//! Training and calibration cameras of a scene.

use frugal_trace::scene::{Bounds, CameraPose, RayScene};
use glam::{EulerRot, Quat, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::free_space::{FreeSpace, HEIGHTS, allows};
use super::{FREE, MovingCamera, TrackSample};

/// Greatest pitch of a camera in free space, radians: cameras look ahead more than up or down.
const PITCH: f32 = 0.5;
/// Walking speed and turning rate of cameras in free space: metres and radians per second.
const WALK: (f32, f32) = (1.5, 0.5);
/// Track samples per cross-validation group. Small, because at run time a camera has training
/// cameras nearby, as a camera has that is held out alone.
const BLOCK: u32 = 2;
/// Attempts per requested camera.
const TRIES: usize = 60;

/// Shares of cameras on tracks, to within 10 cm, and near tracks, displaced and rotated. The rest is
/// from free space. More on tracks fit the map to these.
const SHARES: (f64, f64) = (0.6, 0.15);

/// Disjoint sets of cameras for two purposes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraSet {
    /// Cameras for searching settings and fitting frontiers.
    pub training: Vec<MovingCamera>,
    /// Cameras for calibrating error budgets.
    pub calibration: Vec<MovingCamera>,
}

/// A sample for each frame of `seconds`, and at least one: `pose` gives the camera's by the time since
/// the start.
pub fn sampled(
    seconds: f64,
    frames_per_second: f64,
    pose: impl Fn(f64) -> Option<CameraPose>,
) -> Vec<TrackSample> {
    let count = (seconds * frames_per_second).round().max(1.0) as usize;
    let step = frames_per_second.recip();
    let at = |frame: usize| pose(frame as f64 * step);
    (0..count)
        .filter_map(|frame| {
            Some(TrackSample::between(at(frame.saturating_sub(1))?, at(frame)?, step as f32))
        })
        .collect()
}

/// Sources of cameras.
struct Source<'a> {
    rays: &'a RayScene,
    tracks: &'a [Vec<TrackSample>],
    space: FreeSpace,
    heights: (f32, f32),
    lens: (f32, f32),
}

impl CameraSet {
    /// Samples `count` training cameras and `calibration` others. Deterministic in `seed`.
    ///
    /// `lens`: vertical field of view in radians, and width ÷ height. Returns fewer cameras where
    /// few positions can be reached; none where no position sees any geometry.
    pub fn sample(
        rays: &RayScene,
        bounds: &Bounds,
        tracks: &[Vec<TrackSample>],
        [count, calibration]: [usize; 2],
        lens: (f32, f32),
        seed: u64,
    ) -> Self {
        let heights = heights(rays, tracks);
        let seeds: Vec<Vec3> =
            tracks.iter().flatten().step_by(5).map(|sample| sample.pose.position).collect();
        let source = Source {
            rays,
            tracks,
            space: FreeSpace::fill(rays, bounds, &seeds, heights),
            heights,
            lens,
        };
        // Separate streams: the number of training cameras does not affect the calibration cameras.
        let stream = |number| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(number);
            random
        };
        Self {
            training: source.sample(count, stream(0)),
            calibration: source.sample(calibration, stream(1)),
        }
    }
}

/// Heights of the tracks, with a margin of 30 cm; the default's without tracks.
fn heights(rays: &RayScene, tracks: &[Vec<TrackSample>]) -> (f32, f32) {
    let below = |sample: &TrackSample| {
        Some(rays.closest(sample.pose.position, Vec3::NEG_Y, 50.0)?.distance)
    };
    let heights = tracks.iter().flatten().filter_map(below).map(|height| (height, height));
    let range = heights.reduce(|(low, high), (height, _)| (low.min(height), high.max(height)));
    range.map_or(HEIGHTS, |(low, high)| (low - 0.3, high + 0.3))
}

/// Number and samples of the track with sample `of_all` of all tracks' samples, and the sample's
/// index in it.
fn locate(tracks: &[Vec<TrackSample>], of_all: usize) -> Option<(usize, &[TrackSample], usize)> {
    let mut index = of_all;
    for (number, track) in tracks.iter().enumerate() {
        if index < track.len() {
            return Some((number, track, index));
        }
        index -= track.len();
    }
    None
}

impl Source<'_> {
    fn sample(&self, count: usize, mut random: ChaCha8Rng) -> Vec<MovingCamera> {
        let count_of = |share: f64| {
            if self.tracks.is_empty() { 0 } else { (share * count as f64).round() as usize }
        };
        let on = count_of(SHARES.0);
        let near = count_of(SHARES.1).min(count - on);
        let on_tracks = (0..on).filter_map(|index| {
            let near =
                self.attempt(|random| self.on_track(index, on, 0.1, 0.05, random), &mut random);
            // Where the track is closer to surfaces than free cameras may be, its own cameras are
            // right: without them, the views of highest error would be missing.
            near.or_else(|| self.on_track(index, on, 0.0, 0.0, &mut random))
        });
        let tracked: Vec<_> = on_tracks.collect();
        let near_tracks = (0..near).filter_map(|index| {
            self.attempt(|random| self.on_track(index, near, 0.8, 0.6, random), &mut random)
        });
        let beside: Vec<_> = near_tracks.collect();
        let in_space = |_| self.attempt(|random| self.in_free_space(random), &mut random);
        let free = (tracked.len() + beside.len()..count).map_while(in_space).collect();
        evenly_mixed([tracked, beside, free])
    }

    /// The first camera that has clearance and sees geometry.
    fn attempt(
        &self,
        mut sample: impl FnMut(&mut ChaCha8Rng) -> Option<MovingCamera>,
        random: &mut ChaCha8Rng,
    ) -> Option<MovingCamera> {
        let is_usable = |camera: &MovingCamera| {
            let CameraPose { position, rotation } = camera.pose;
            allows(self.rays, position, self.heights)
                && self.rays.sees_geometry(position, rotation, self.lens.0, self.lens.1)
        };
        (0..TRIES).find_map(|_| sample(random).filter(is_usable))
    }

    /// A camera from stratum `index` of `count` of all tracks' samples, displaced by up to `shift`
    /// metres and rotated by up to `turn` radians.
    fn on_track(
        &self,
        index: usize,
        count: usize,
        shift: f32,
        turn: f32,
        random: &mut ChaCha8Rng,
    ) -> Option<MovingCamera> {
        let all: usize = self.tracks.iter().map(Vec::len).sum();
        let of_all = ((index as f64 + random.random::<f64>()) / count as f64 * all as f64) as usize;
        let (number, track, sample_index) = locate(self.tracks, of_all)?;
        let TrackSample { pose, velocity, turn: turning } = track[sample_index];
        let mut within = |greatest: f32| random.random_range(-greatest..=greatest);
        // Less vertically than horizontally, as people move and look.
        let offset = pose.rotation * Vec3::new(within(shift), 0.0, within(shift))
            + Vec3::Y * within(0.25 * shift);
        let rotation = Quat::from_rotation_y(within(turn))
            * pose.rotation
            * Quat::from_rotation_x(within(0.4 * turn));
        let pose = CameraPose { position: pose.position + offset, rotation: rotation.normalize() };
        // A displaced camera must be reachable from the track.
        let from = track[sample_index].pose.position;
        let reaches = !self.rays.any(from, pose.position - from, 1.0);
        let group = (number as u32) << 20 | (sample_index as u32 / BLOCK);
        reaches.then_some(MovingCamera { pose, velocity, turn: turning, group })
    }

    fn in_free_space(&self, random: &mut ChaCha8Rng) -> Option<MovingCamera> {
        let (position, group) = self.space.sample(random)?;
        let yaw = random.random_range(0.0..std::f32::consts::TAU);
        // The mean of two: mostly level.
        let pitch = (random.random_range(-PITCH..PITCH) + random.random_range(-PITCH..PITCH)) / 2.0;
        let rotation = Quat::from_euler(EulerRot::YXZ, yaw, pitch, 0.0);
        let course = Quat::from_rotation_y(random.random_range(0.0..std::f32::consts::TAU));
        let turn = Vec3::Y * random.random_range(-WALK.1..WALK.1);
        Some(MovingCamera {
            pose: CameraPose { position, rotation },
            velocity: course * Vec3::NEG_Z * WALK.0,
            turn,
            group: group | FREE,
        })
    }
}

/// Interleaves the lists so that every prefix has the same share of each, spread over the whole
/// list: a run that ends early has covered the whole scene. The order within a list follows the
/// radical inverse (van der Corput 1935).
fn evenly_mixed(lists: [Vec<MovingCamera>; 3]) -> Vec<MovingCamera> {
    let mut ranked: Vec<(f64, MovingCamera)> = Vec::new();
    for list in lists {
        let mut order: Vec<usize> = (0..list.len()).collect();
        order.sort_by_key(|index| (*index as u32).reverse_bits());
        let count = list.len() as f64;
        ranked.extend(
            order
                .into_iter()
                .enumerate()
                .map(|(rank, index)| ((rank as f64 + 0.5) / count, list[index])),
        );
    }
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().map(|(_, camera)| camera).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_covers_the_whole_list() {
        let pose = |x: f32| CameraPose { position: Vec3::X * x, rotation: Quat::IDENTITY };
        let camera = |x: usize| MovingCamera {
            pose: pose(x as f32),
            velocity: Vec3::ZERO,
            turn: Vec3::ZERO,
            group: 0,
        };
        let mixed =
            evenly_mixed([(0..32).map(camera).collect(), (100..116).map(camera).collect(), vec![]]);
        let first: Vec<f32> = mixed[..12].iter().map(|camera| camera.pose.position.x).collect();
        let of_first: Vec<f32> = first.iter().copied().filter(|x| *x < 50.0).collect();
        assert_eq!((mixed.len(), of_first.len()), (48, 8));
        assert!(
            (0..4).all(|part| of_first.iter().filter(|x| (**x as usize) / 8 == part).count() == 2),
            "{of_first:?}"
        );
    }

    #[test]
    fn a_jump_is_no_motion() {
        let pose = |x: f32| CameraPose { position: Vec3::X * x, rotation: Quat::IDENTITY };
        assert_eq!(TrackSample::between(pose(0.0), pose(0.1), 0.1).velocity, Vec3::X);
        assert_eq!(TrackSample::between(pose(0.0), pose(50.0), 0.1).velocity, Vec3::ZERO);
        assert_eq!(TrackSample::between(pose(f32::NAN), pose(0.0), 0.1).velocity, Vec3::ZERO);
    }
}

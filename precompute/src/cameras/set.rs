//! Training and calibration cameras of a scene.

use bevy::math::{EulerRot, Quat, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::free_space::is_usable;
use super::pose::FREE;
use super::{Clearance, FreeSpace, MovingCamera};
use crate::scene::{Bounds, CameraPath, CameraPose, RayScene};

/// Greatest pitch of a camera in free space, radians: players look ahead more than up or down.
const PITCH: f32 = 0.5;
/// Walking speed and turning rate of cameras in free space: metres and radians per second.
const WALK: (f32, f32) = (1.5, 0.5);
/// Samples of a track whose cameras are kept or held out together: at run time a camera has
/// training cameras beside it, as one has that is held out alone.
const BLOCK: u32 = 2;
/// Draws for each camera that is wanted.
const TRIES: usize = 60;

/// One moment of a track: a path of the scene, or a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackSample {
    /// Where the camera was.
    pub pose: CameraPose,
    /// Metres per second.
    pub velocity: Vec3,
    /// Axis times radians per second.
    pub turn: Vec3,
}

/// Which share of the cameras comes from where. The rest is free space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMix {
    /// Share on tracks, to within a foot's breadth. Higher values fit the map to the tracks.
    pub on_tracks: f64,
    /// Share near tracks: to the side, looking elsewhere.
    pub near_tracks: f64,
}

impl Default for CameraMix {
    fn default() -> Self {
        Self { on_tracks: 0.6, near_tracks: 0.15 }
    }
}

/// Cameras for two purposes, none in both.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraSet {
    /// What settings are searched and frontiers are fitted on.
    pub training: Vec<MovingCamera>,
    /// What error budgets are calibrated on.
    pub calibration: Vec<MovingCamera>,
}

/// Samples of `paths` at `frames_per_second`.
pub fn tracks_of<'a>(
    paths: impl IntoIterator<Item = &'a CameraPath>,
    frames_per_second: f64,
) -> Vec<Vec<TrackSample>> {
    let track = |path: &CameraPath| {
        let step = frames_per_second.recip() as f32;
        let count = (path.duration() / step).round().max(1.0) as usize;
        let pose = |frame: usize| path.sample(path.start() + frame as f32 * step);
        (0..count)
            .filter_map(|frame| Some(sample(pose(frame.saturating_sub(1))?, pose(frame)?, step)))
            .collect()
    };
    paths.into_iter().map(track).filter(|track: &Vec<_>| !track.is_empty()).collect()
}

/// The moment at `to`, one `step` of seconds after `from`. A jump is a cut: the camera then stands
/// still.
pub(super) fn sample(from: CameraPose, to: CameraPose, step: f32) -> TrackSample {
    let velocity = (to.position - from.position) / step;
    let turn = (to.rotation * from.rotation.inverse()).to_scaled_axis() / step;
    let is_cut = !(velocity.length() < 30.0 && turn.length() < 12.0);
    if is_cut {
        TrackSample { pose: to, velocity: Vec3::ZERO, turn: Vec3::ZERO }
    } else {
        TrackSample { pose: to, velocity, turn }
    }
}

/// What cameras are drawn from.
struct Source<'a> {
    rays: &'a RayScene,
    tracks: &'a [Vec<TrackSample>],
    space: FreeSpace,
    clearance: Clearance,
    lens: (f32, f32),
}

impl CameraSet {
    /// Draws `count` training cameras, and `calibration` others. The same `seed` draws the same
    /// ones.
    ///
    /// `lens`: vertical field of view in radians, and width ÷ height. Fewer cameras come back where
    /// few places can be reached; none where nothing can be seen from anywhere.
    pub fn draw(
        rays: &RayScene,
        bounds: &Bounds,
        tracks: &[Vec<TrackSample>],
        [count, calibration]: [usize; 2],
        mix: &CameraMix,
        lens: (f32, f32),
        seed: u64,
    ) -> Self {
        let clearance = clearance(rays, tracks);
        let seeds: Vec<Vec3> =
            tracks.iter().flatten().step_by(5).map(|sample| sample.pose.position).collect();
        let source = Source {
            rays,
            tracks,
            space: FreeSpace::fill(rays, bounds, &seeds, &clearance),
            clearance,
            lens,
        };
        let training = source.draw(count, mix, ChaCha8Rng::seed_from_u64(seed));
        // A stream of its own: more training cameras do not change which ones calibrate.
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1);
        Self { training, calibration: source.draw(calibration, mix, random) }
    }
}

/// Heights as on the tracks, with a hand's breadth of play; the default's without tracks.
fn clearance(rays: &RayScene, tracks: &[Vec<TrackSample>]) -> Clearance {
    let heights = tracks
        .iter()
        .flatten()
        .filter_map(|sample| Some(rays.closest(sample.pose.position, Vec3::NEG_Y, 50.0)?.distance));
    let range = heights.fold(None, |range: Option<(f32, f32)>, height| {
        Some(range.map_or((height, height), |(low, high)| (low.min(height), high.max(height))))
    });
    let default = Clearance::default();
    Clearance {
        height: range.map_or(default.height, |(low, high)| (low - 0.3, high + 0.3)),
        ..default
    }
}

impl Source<'_> {
    fn draw(&self, count: usize, mix: &CameraMix, mut random: ChaCha8Rng) -> Vec<MovingCamera> {
        let share = |share: f64| {
            if self.tracks.is_empty() {
                0
            } else {
                (share.clamp(0.0, 1.0) * count as f64).round() as usize
            }
        };
        let on = share(mix.on_tracks);
        let near = share(mix.near_tracks).min(count - on.min(count));
        let mut tracked = Vec::new();
        for index in 0..on {
            tracked.extend(
                self.attempt(|random| self.on_track(index, on, 0.1, 0.05, random), &mut random),
            );
        }
        let mut beside = Vec::new();
        for index in 0..near {
            beside.extend(
                self.attempt(|random| self.on_track(index, near, 0.8, 0.6, random), &mut random),
            );
        }
        let mut free = Vec::new();
        while tracked.len() + beside.len() + free.len() < count {
            let Some(camera) = self.attempt(|random| self.in_free_space(random), &mut random)
            else {
                break;
            };
            free.push(camera);
        }
        evenly_mixed([tracked, beside, free])
    }

    fn attempt(
        &self,
        mut draw: impl FnMut(&mut ChaCha8Rng) -> Option<MovingCamera>,
        random: &mut ChaCha8Rng,
    ) -> Option<MovingCamera> {
        (0..TRIES).find_map(|_| {
            draw(random)
                .filter(|camera| is_usable(self.rays, &camera.pose, &self.clearance, self.lens))
        })
    }

    /// The `index`-th of `count` strata of all tracks' samples, moved by up to `shift` metres and
    /// turned by up to `turn` radians.
    fn on_track(
        &self,
        index: usize,
        count: usize,
        shift: f32,
        turn: f32,
        random: &mut ChaCha8Rng,
    ) -> Option<MovingCamera> {
        let all: usize = self.tracks.iter().map(Vec::len).sum();
        let mut place =
            ((index as f64 + random.random::<f64>()) / count as f64 * all as f64) as usize;
        let (number, track) = self.tracks.iter().enumerate().find(|(_, track)| {
            let is_here = place < track.len();
            place -= if is_here { 0 } else { track.len() };
            is_here
        })?;
        let TrackSample { pose, velocity, turn: turning } = track[place];
        let mut within = |greatest: f32| random.random_range(-greatest..=greatest);
        // Less up and down than to the sides, as people move and look.
        let offset = pose.rotation * Vec3::new(within(shift), 0.0, within(shift))
            + Vec3::Y * within(0.25 * shift);
        let rotation = Quat::from_rotation_y(within(turn))
            * pose.rotation
            * Quat::from_rotation_x(within(0.4 * turn));
        let pose = CameraPose { position: pose.position + offset, rotation: rotation.normalize() };
        // A camera to the side of a track must be able to get there from it.
        let from = track[place].pose.position;
        let reaches = !self.rays.any(from, pose.position - from, 1.0);
        let group = (number as u32) << 20 | (place as u32 / BLOCK);
        reaches.then_some(MovingCamera { pose, velocity, turn: turning, group })
    }

    fn in_free_space(&self, random: &mut ChaCha8Rng) -> Option<MovingCamera> {
        let (position, group) = self.space.draw(random)?;
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

/// Cameras of all lists in such an order that any first part of it has the same share of each,
/// spread over all of it: a run that ends early has seen everywhere. Places within a list follow
/// the radical inverse (van der Corput 1935).
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
    use crate::scene::{SceneDescription, load};

    fn courtyard() -> (SceneDescription, RayScene) {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../assets/scenes/courtyard.scene.ron");
        let scene = load(&file).expect("a scene");
        let rays = RayScene::from_geometry(&scene.geometry().expect("its geometry"));
        (scene, rays)
    }

    #[test]
    fn cameras_stand_where_people_could_and_no_set_shares_one() {
        let (scene, rays) = courtyard();
        let bounds = scene.camera_bounds(None);
        let tracks = tracks_of(scene.paths.values(), 15.0);
        let lens = (scene.camera.vertical_fov.to_radians(), 16.0 / 9.0);
        let draw = |seed| {
            CameraSet::draw(&rays, &bounds, &tracks, [60, 20], &CameraMix::default(), lens, seed)
        };
        let set = draw(3);
        assert_eq!((set.training.len(), set.calibration.len()), (60, 20));
        assert_eq!(set, draw(3), "the same seed");
        assert_ne!(set, draw(4));
        for camera in set.training.iter().chain(&set.calibration) {
            let position = camera.pose.position;
            assert!(!rays.inside_geometry(position), "{position}");
            // Under the arcade or in the court: a floor below, within the walls.
            let floor = rays.closest(position, Vec3::NEG_Y, 10.0).expect("a floor").distance;
            assert!((0.8..3.0).contains(&floor), "{floor} m above the floor");
            assert!(camera.pose.forward().y.abs() < 0.75, "looks ahead");
        }
        assert!(
            set.training
                .iter()
                .all(|a| set.calibration.iter().all(|b| a.pose.position != b.pose.position))
        );
        let is_near = |camera: &&MovingCamera| {
            tracks
                .iter()
                .flatten()
                .any(|sample| sample.pose.position.distance(camera.pose.position) < 0.3)
        };
        let share = set.training.iter().filter(is_near).count();
        assert!((30..50).contains(&share), "{share} of 60 near a path");
    }

    #[test]
    fn without_tracks_all_come_from_free_space_and_without_space_none() {
        let (scene, rays) = courtyard();
        let bounds = scene.camera_bounds(None);
        let draw = |rays: &RayScene, bounds| {
            CameraSet::draw(rays, bounds, &[], [10, 5], &CameraMix::default(), (1.0, 1.5), 1)
        };
        assert_eq!(draw(&rays, &bounds).training.len(), 10);
        let nothing = RayScene::new([]);
        assert!(draw(&nothing, &bounds).training.is_empty(), "nothing can be seen");
    }

    #[test]
    fn the_first_cameras_are_everywhere() {
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
        assert_eq!(sample(pose(0.0), pose(0.1), 0.1).velocity, Vec3::X);
        assert_eq!(sample(pose(0.0), pose(50.0), 0.1).velocity, Vec3::ZERO);
        assert_eq!(sample(pose(f32::NAN), pose(0.0), 0.1).velocity, Vec3::ZERO);
    }
}

//! Random cameras, and which frontier each is given.

use bevy::math::{EulerRot, Quat, Vec3};
use bevy_frugal_gi::frontier::{Bounds, CameraView, FrontierMap, FrontierStore};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scene::CameraPose;

/// Largest angle of a view above or below the horizon, radians: apps look ahead more than up or down.
const PITCH: f32 = 0.5;

/// Places tried for each camera that is wanted; in a scene that is mostly walls few of them will do.
const TRIES_PER_CAMERA: usize = 40;

/// Cameras as an app may have them: anywhere in the bounds, level but for up to half a radian, turned any way.
#[derive(Clone, Debug)]
pub struct RandomCameras {
    bounds: Bounds,
    random: ChaCha8Rng,
}

impl RandomCameras {
    /// Cameras within `bounds`; the same `seed` draws the same ones.
    pub fn new(bounds: Bounds, seed: u64) -> Self {
        Self { bounds, random: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// The next camera. It may stand in a wall, or see nothing.
    pub fn draw(&mut self) -> CameraPose {
        let random = &mut self.random;
        let position = self.bounds.from_unit(Vec3::new(random.random(), random.random(), random.random()));
        let yaw = random.random_range(0.0..std::f32::consts::TAU);
        let rotation = Quat::from_euler(EulerRot::YXZ, yaw, random.random_range(-PITCH..PITCH), 0.0);
        CameraPose { position, rotation }
    }
}

/// All cameras that are given the same frontier, and some of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Index into the octree's frontiers.
    pub frontier: usize,
    /// Some of its cameras.
    pub cameras: Vec<CameraPose>,
    /// How many random cameras were given this frontier, whatever they see: its share of the map.
    pub hits: usize,
}

/// Index of the frontier that the run time takes at `camera`.
pub(super) fn frontier_at(map: &FrontierMap, camera: &CameraPose) -> Option<usize> {
    let [width, height] = map.capture.size;
    let view = CameraView {
        position: camera.position,
        rotation: camera.rotation,
        vertical_fov: map.capture.vertical_fov.to_radians(),
        aspect: width as f32 / height as f32,
    };
    let sample = map.look_up(&view)?.camera;
    map.octree.corners.get(sample.corner as usize).map(|corner| corner.frontiers[sample.direction.index()] as usize)
}

/// The cells of `map`, those that most cameras fall into first, with up to `most` cameras each that `sees` accepts.
///
/// Stops early when every frontier has its cameras, or `keep_going` says no. Frontiers that no camera was given have no cell.
pub fn find_cells(
    map: &FrontierMap,
    most: usize,
    random: &mut RandomCameras,
    mut sees: impl FnMut(&CameraPose) -> bool,
    mut keep_going: impl FnMut() -> bool,
) -> Vec<Cell> {
    let cell = |frontier| Cell { frontier, cameras: Vec::new(), hits: 0 };
    let mut cells: Vec<Cell> = (0..map.octree.frontiers.len()).map(cell).collect();
    let mut missing = most * cells.len();
    for _ in 0..TRIES_PER_CAMERA * missing {
        if missing == 0 || !keep_going() {
            break;
        }
        let camera = random.draw();
        let Some(cell) = frontier_at(map, &camera).and_then(|index| cells.get_mut(index)) else { continue };
        cell.hits += 1;
        // Rays cost a hundred times a look-up, and most draws are given a frontier that has its cameras.
        if cell.cameras.len() < most && sees(&camera) {
            cell.cameras.push(camera);
            missing -= 1;
        }
    }
    cells.retain(|cell| !cell.cameras.is_empty());
    cells.sort_by_key(|cell| (std::cmp::Reverse(cell.hits), cell.frontier));
    cells
}

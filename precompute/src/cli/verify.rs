//! Holds a map against cameras that it never saw.

use bevy::math::{EulerRot, Quat, Vec3};
use bevy_frugal_gi::frontier::{CameraView, Correction, FrontierMap, FrontierPoint, FrontierStore};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{CliError, progress};
use crate::stage::RemoteStage;

/// Cameras to measure at; in a scene that is mostly walls there may be fewer.
const CAMERAS: usize = 16;

/// Places tried for them.
const TRIES: usize = 40 * CAMERAS;

/// The picture is all that is wanted.
const METERED_FRAMES: u32 = 1;

/// Largest angle of a view above or below the horizon, radians: apps look ahead more than up or down.
const PITCH: f32 = 0.5;

/// Predicted and measured errors of a few frontier points at random cameras inside the map's bounds.
pub(super) fn correction(stage: &mut RemoteStage, map: &FrontierMap, seed: u64) -> Result<Correction, CliError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x5EED_CA3E_7A00);
    let [width, height] = stage.size();
    let vertical_fov = stage.vertical_fov_degrees().to_radians();
    let aspect = width as f32 / height as f32;
    let mut pairs = Vec::new();
    let mut cameras = 0;
    for _ in 0..TRIES {
        if cameras == CAMERAS || progress::interrupted() {
            break;
        }
        let position = map.bounds.from_unit(Vec3::new(random.random(), random.random(), random.random()));
        let yaw = random.random_range(0.0..std::f32::consts::TAU);
        let rotation = Quat::from_euler(EulerRot::YXZ, yaw, random.random_range(-PITCH..PITCH), 0.0);
        if !stage.sees_from(position, rotation) {
            continue;
        }
        let Some(found) = map.look_up(&CameraView { position, rotation, vertical_fov, aspect }) else { continue };
        for point in quarters(found.frontier.points()) {
            let measured = stage.measure(position, rotation, point.settings, METERED_FRAMES)?;
            pairs.push((point.cost.error, measured.error));
        }
        cameras += 1;
    }
    Ok(Correction::fit(&pairs))
}

/// The points a quarter, half and three quarters along a frontier: its ends are in no doubt, or nobody's choice.
fn quarters(points: &[FrontierPoint]) -> impl Iterator<Item = &FrontierPoint> {
    let mut indices: Vec<usize> = [1, 2, 3].into_iter().map(|quarter| quarter * points.len().saturating_sub(1) / 4).collect();
    indices.dedup();
    indices.into_iter().filter_map(|index| points.get(index))
}

//! Cameras that a map is trained on, and cameras that its error budgets are calibrated on.
//!
//! Cameras come from the scene's paths and recordings, from their vicinity, and from the free space
//! that they reach. None is inside a solid, outside the reachable space, or within the clearance of
//! a wall. Independent of the renderer.
mod free_space;
mod set;

use frugal_core::frontier::CameraView;
use frugal_trace::scene::CameraPose;
use glam::{Quat, Vec3};

pub use set::{CameraSet, sampled};

/// A camera's pose and motion at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingCamera {
    /// The pose.
    pub pose: CameraPose,
    /// Metres per second.
    pub velocity: Vec3,
    /// Rotation per second: axis times radians, in world space.
    pub turn: Vec3,
    /// Cross-validation group: cameras near each other in time or space are held out together.
    pub group: u32,
}

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

/// What a camera at `pose` shows through a lens: vertical field of view in radians, and width ÷ height.
pub(crate) fn view_from(pose: &CameraPose, (vertical_fov, aspect): (f32, f32)) -> CameraView {
    CameraView { position: pose.position, rotation: pose.rotation, vertical_fov, aspect }
}

/// Flag in the [`group`](MovingCamera::group) of cameras in free space, away from any app's camera.
const FREE: u32 = 1 << 31;

impl MovingCamera {
    /// Whether the camera is on or near a path or a recording.
    pub fn is_on_track(&self) -> bool {
        self.group & FREE == 0
    }

    /// The last `frames` poses at `frames_per_second`, the current one last.
    pub fn clip(&self, frames: u32, frames_per_second: f64) -> Vec<CameraPose> {
        let pose = |back: u32| {
            let seconds = -(f64::from(back) / frames_per_second) as f32;
            let turned = Quat::from_scaled_axis(self.turn * seconds) * self.pose.rotation;
            let position = self.pose.position + self.velocity * seconds;
            CameraPose { position, rotation: turned.normalize() }
        };
        (0..frames.max(1)).rev().map(pose).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clip_ends_where_the_camera_is() {
        let pose = CameraPose { position: Vec3::new(1.0, 2.0, 3.0), rotation: Quat::IDENTITY };
        let camera = MovingCamera { pose, velocity: Vec3::X * 3.0, turn: Vec3::Y, group: 0 };
        let clip = camera.clip(4, 30.0);
        assert_eq!((clip.len(), clip[3]), (4, pose));
        assert!((clip[0].position.x - 0.7).abs() < 1e-6 && clip[0].rotation.y < 0.0);
        assert_eq!(camera.clip(0, 30.0).len(), 1);
    }
}

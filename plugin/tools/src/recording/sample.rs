//! A camera's pose and view at one moment, as a row of the file.

use std::f32::consts::PI;

use bevy::math::{DQuat, Quat, Vec3};
use bevy_frugal_gi::frontier::CameraView;
use serde::{Deserialize, Serialize};

use crate::row_log::Row;

/// A camera's pose and view at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraSample {
    /// Seconds since the app started; finite, at least 0.
    pub time_s: f64,
    /// Number of the camera in the file, unique per camera and run of the app.
    pub camera: u32,
    /// World position, metres; each coordinate within ±[`MAX_COORDINATE`](Self::MAX_COORDINATE).
    pub x_m: f32,
    /// See `x_m`.
    pub y_m: f32,
    /// See `x_m`.
    pub z_m: f32,
    /// World rotation, a quaternion of unit length; the camera looks along its own −Z.
    pub qx: f32,
    /// See `qx`.
    pub qy: f32,
    /// See `qx`.
    pub qz: f32,
    /// See `qx`.
    pub qw: f32,
    /// Vertical field of view, radians, in (0, π). 0.001 for an orthographic camera.
    pub vertical_fov_rad: f32,
    /// Width ÷ height of the image; finite, above 0.
    pub aspect: f32,
}

impl CameraSample {
    /// Maximum absolute coordinate, metres. Beyond it an `f32` does not resolve a metre.
    pub const MAX_COORDINATE: f32 = 1e7;

    /// Minimum length of a quaternion that counts as a rotation.
    const MIN_ROTATION_LENGTH: f64 = 1e-6;

    /// A sample of a camera's view at a time, in seconds.
    pub fn new(time_s: f64, camera: u32, view: &CameraView) -> Self {
        let CameraView { position, rotation, vertical_fov, aspect } = *view;
        let ([x_m, y_m, z_m], [qx, qy, qz, qw]) = (position.to_array(), rotation.to_array());
        let vertical_fov_rad = vertical_fov;
        Self { time_s, camera, x_m, y_m, z_m, qx, qy, qz, qw, vertical_fov_rad, aspect }
    }

    /// The camera's view, without its time and number.
    pub fn view(&self) -> CameraView {
        CameraView {
            position: Vec3::new(self.x_m, self.y_m, self.z_m),
            rotation: Quat::from_xyzw(self.qx, self.qy, self.qz, self.qw),
            vertical_fov: self.vertical_fov_rad,
            aspect: self.aspect,
        }
    }

    /// Whether the view differs from `last`: the camera moved by `distance` metres or more, or it
    /// rotated, or a field of view changed, by `angle` radians or more. A NaN limit is exceeded by
    /// any motion.
    pub(super) fn differs(&self, last: &Self, distance: f32, angle: f32) -> bool {
        let (new, old) = (self.view(), last.view());
        let half_width = |view: &CameraView| ((view.vertical_fov / 2.0).tan() * view.aspect).atan();
        let angles = [
            new.rotation.angle_between(old.rotation),
            new.vertical_fov - old.vertical_fov,
            2.0 * (half_width(&new) - half_width(&old)),
        ];
        // This comparison treats a NaN limit as exceeded.
        let stays = new.position.distance(old.position) < distance
            && angles.iter().all(|a| a.abs() < angle);
        !stays
    }
}

impl Row for CameraSample {
    const PLUGIN: &'static str = "CameraRecorderPlugin";
    const PREAMBLE: &'static str = "frugal-cameras 1\n";

    /// Normalises the rotation, too.
    fn validated(self) -> Result<Self, String> {
        let view = self.view();
        // In `f64`, squares of `f32` numbers neither overflow nor underflow.
        let rotation = DQuat::from_array(view.rotation.to_array().map(f64::from));
        let length = rotation.length();
        let near = |value: f32| value.abs() <= Self::MAX_COORDINATE;
        let open = |value: f32, end: f32| value > 0.0 && value < end;
        let is_rotation = length.is_finite() && length >= Self::MIN_ROTATION_LENGTH;
        let Self { time_s, x_m, y_m, z_m, vertical_fov_rad, aspect, .. } = self;
        for (field, value, is_valid, expected) in [
            ("x_m", x_m.into(), near(x_m), "from -1e7 to 1e7"),
            ("y_m", y_m.into(), near(y_m), "from -1e7 to 1e7"),
            ("z_m", z_m.into(), near(z_m), "from -1e7 to 1e7"),
            ("qx,qy,qz,qw", length, is_rotation, "finite, of a length of at least 1e-6"),
            ("time_s", time_s, time_s.is_finite() && time_s >= 0.0, "finite, from 0"),
            (
                "vertical_fov_rad",
                vertical_fov_rad.into(),
                open(vertical_fov_rad, PI),
                "between 0 and pi",
            ),
            ("aspect", aspect.into(), open(aspect, f32::INFINITY), "finite and above 0"),
        ] {
            if !is_valid {
                return Err(format!("`{field}` is {value}, which must be {expected}"));
            }
        }
        // A rotation of unit length up to rounding stays bit-identical.
        if view.rotation.is_normalized() {
            return Ok(self);
        }
        let rotation = (rotation / length).as_quat();
        Ok(Self::new(time_s, self.camera, &CameraView { rotation, ..view }))
    }
}

#[cfg(test)]
#[path = "sample_tests.rs"]
mod tests;

//! A camera's pose and view at one moment.

use bevy::math::{DQuat, Quat, Vec3};

use super::InvalidSample;
use bevy_frugal_gi::frontier::CameraView;

/// A camera's pose and view at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSample {
    /// Seconds since the app started; finite, at least 0.
    pub time_s: f64,
    /// Number of the camera in the file, unique per camera and run of the app.
    pub camera: u32,
    /// World position, metres; each coordinate within ±[`MAX_COORDINATE`](Self::MAX_COORDINATE).
    pub position: Vec3,
    /// World rotation, of unit length; the camera looks along its own −Z.
    pub rotation: Quat,
    /// Vertical field of view, radians, in (0, π). 0.001 for an orthographic camera.
    pub vertical_fov: f32,
    /// Width ÷ height of the image; finite, above 0.
    pub aspect: f32,
}

impl CameraSample {
    /// Maximum absolute coordinate, metres. Beyond it an `f32` does not resolve a metre.
    pub const MAX_COORDINATE: f32 = 1e7;

    /// Minimum length of a quaternion that counts as a rotation.
    const MIN_ROTATION_LENGTH: f64 = 1e-6;

    /// Validates the sample and normalises its rotation.
    ///
    /// # Errors
    ///
    /// [`InvalidSample`] when a number is NaN or out of its range, or the rotation's length is
    /// below 10⁻⁶.
    pub fn validated(self) -> Result<Self, InvalidSample> {
        let check = |field, value: f64, valid: bool, expected| {
            if valid { Ok(()) } else { Err(InvalidSample { field, value, expected }) }
        };
        let near = |value: f32| value.abs() <= Self::MAX_COORDINATE;
        for (field, value) in ["x_m", "y_m", "z_m"].into_iter().zip(self.position.to_array()) {
            check(field, value.into(), near(value), "from -1e7 to 1e7")?;
        }
        for (field, value) in ["qx", "qy", "qz", "qw"].into_iter().zip(self.rotation.to_array()) {
            check(field, value.into(), value.is_finite(), "finite")?;
        }
        // In `f64`, squares of `f32` numbers neither overflow nor underflow.
        let rotation = DQuat::from_array(self.rotation.to_array().map(f64::from));
        let length = rotation.length();
        check(
            "qx,qy,qz,qw",
            length,
            length >= Self::MIN_ROTATION_LENGTH,
            "of a length of at least 1e-6",
        )?;
        let open = |value: f32, end: f32| value > 0.0 && value < end;
        let (time, fov, aspect) = (self.time_s, self.vertical_fov, self.aspect);
        check("time_s", time, time.is_finite() && time >= 0.0, "finite, from 0")?;
        check("vertical_fov_rad", fov.into(), open(fov, std::f32::consts::PI), "between 0 and pi")?;
        check("aspect", aspect.into(), open(aspect, f32::INFINITY), "finite and above 0")?;
        // A rotation of unit length up to rounding stays bit-identical.
        let unit = self.rotation.is_normalized();
        Ok(Self {
            rotation: if unit { self.rotation } else { (rotation / length).as_quat() },
            ..self
        })
    }

    /// The camera's view, without its time and number.
    pub fn view(&self) -> CameraView {
        let Self { position, rotation, vertical_fov, aspect, .. } = *self;
        CameraView { position, rotation, vertical_fov, aspect }
    }

    /// Whether the view differs from `last`: the camera moved by `distance` metres or more, or it
    /// rotated, or a field of view changed, by `angle` radians or more. A NaN limit is exceeded by
    /// any motion.
    pub(super) fn differs(&self, last: &Self, distance: f32, angle: f32) -> bool {
        let half_width = |sample: &Self| ((sample.vertical_fov / 2.0).tan() * sample.aspect).atan();
        let angles = [
            self.rotation.angle_between(last.rotation),
            self.vertical_fov - last.vertical_fov,
            2.0 * (half_width(self) - half_width(last)),
        ];
        // This comparison treats a NaN limit as exceeded.
        let stays = self.position.distance(last.position) < distance
            && angles.iter().all(|a| a.abs() < angle);
        !stays
    }
}

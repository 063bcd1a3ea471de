//! A camera's place.

use glam::{Mat3, Quat, Vec3};

/// A camera's position and rotation.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct CameraPose {
    /// Metres.
    pub position: Vec3,
    /// The camera looks along its own −Z; +Y is up in its image.
    pub rotation: Quat,
}

impl CameraPose {
    /// A camera at `position` that looks at `look_at`, with +Y up, or −Z where it looks straight up
    /// or down. A point that is at the camera itself, or not finite, gives the view along −Z.
    pub fn looking_at(position: Vec3, look_at: Vec3) -> Self {
        // Not `normalize`, which gives infinities for very short views.
        let forward = (look_at - position).as_dvec3().normalize_or_zero().as_vec3();
        let forward = if forward == Vec3::ZERO { Vec3::NEG_Z } else { forward };
        let up = if forward.y.abs() > 0.99999 { Vec3::NEG_Z } else { Vec3::Y };
        let right = forward.cross(up).normalize();
        let rotation =
            Quat::from_mat3(&Mat3::from_cols(right, right.cross(forward), -forward)).normalize();
        Self { position, rotation }
    }

    /// View direction, a unit vector.
    pub fn forward(&self) -> Vec3 {
        self.rotation * Vec3::NEG_Z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_valid_in_every_direction() {
        let position = Vec3::new(1.0, 2.0, 3.0);
        for target in [
            Vec3::Y,
            Vec3::NEG_Y,
            Vec3::X,
            Vec3::Z,
            Vec3::new(1e-4, 1.0, 0.0),
            Vec3::new(1e-6, -1.0, 1e-6),
        ] {
            let pose = CameraPose::looking_at(position, position + target);
            assert!(pose.rotation.is_finite() && pose.rotation.is_normalized());
            assert!(
                pose.forward().distance(target.normalize()) < 1e-3,
                "{target}: {}",
                pose.forward()
            );
        }
        let level = CameraPose::looking_at(Vec3::ZERO, Vec3::new(3.0, 1.0, 2.0)).rotation;
        assert!((level * Vec3::X).y.abs() < 1e-6 && (level * Vec3::Y).y > 0.0, "no roll");
        for (from, to) in
            [(position, position), (position, Vec3::NAN), (Vec3::ZERO, Vec3::Y * f32::INFINITY)]
        {
            assert_eq!(CameraPose::looking_at(from, to).forward(), Vec3::NEG_Z);
        }
        let far = CameraPose::looking_at(Vec3::ZERO, Vec3::X * 1e30);
        assert!(far.forward().distance(Vec3::X) < 1e-5);
        let near = CameraPose::looking_at(Vec3::ZERO, Vec3::X * 1e-30);
        assert!(near.forward().distance(Vec3::X) < 1e-5);
    }
}

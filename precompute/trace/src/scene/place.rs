//! Places: boxes in world space, and a camera's pose.

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Least corner, metres.
    #[serde(with = "triple")]
    pub min: Vec3,
    /// Greatest corner, metres.
    #[serde(with = "triple")]
    pub max: Vec3,
}

impl Bounds {
    /// The bounding box of `points`; points that are not finite are ignored. `None` without finite
    /// points.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Option<Self> {
        points.into_iter().filter(|point| point.is_finite()).fold(None, |bounds, point| {
            Some(bounds.map_or(Self { min: point, max: point }, |b: Self| Self {
                min: b.min.min(point),
                max: b.max.max(point),
            }))
        })
    }

    /// Extent along each axis, metres.
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }

    /// Centre, metres.
    pub fn center(&self) -> Vec3 {
        // Halved before the sum, so that the centre of very large boxes does not overflow.
        self.min * 0.5 + self.max * 0.5
    }

    /// Whether `point` is inside or on the surface.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// The box shrunk at each of its six sides by `fraction` of its extent, in [0, 0.5).
    pub fn shrunk(&self, fraction: f32) -> Self {
        let margin = self.size() * fraction.clamp(0.0, 0.499);
        Self { min: self.min + margin, max: self.max - margin }
    }
}

/// Extent of points along each axis; 0 without any.
pub(crate) fn extent(points: impl Iterator<Item = Vec3>) -> Vec3 {
    Bounds::around(points).map_or(Vec3::ZERO, |bounds| bounds.size())
}

/// A camera's position and rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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

/// A vector written as `(x, y, z)`: glam's own form depends on its enabled features.
pub mod triple {
    use glam::Vec3;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes a vector.
    ///
    /// # Errors
    /// The serializer's own.
    pub fn serialize<S: Serializer>(vector: &Vec3, serializer: S) -> Result<S::Ok, S::Error> {
        vector.to_array().serialize(serializer)
    }

    /// Reads a vector.
    ///
    /// # Errors
    /// The deserializer's own.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
        <[f32; 3]>::deserialize(deserializer).map(Vec3::from_array)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surrounds_finite_points_only() {
        let bounds = Bounds::around([
            Vec3::splat(f32::NAN),
            Vec3::ONE,
            Vec3::new(-1.0, 2.0, f32::INFINITY),
            Vec3::new(3.0, 0.0, 1.0),
        ]);
        assert_eq!(
            bounds,
            Some(Bounds { min: Vec3::new(1.0, 0.0, 1.0), max: Vec3::new(3.0, 1.0, 1.0) })
        );
        assert_eq!(Bounds::around([]), None);
    }

    #[test]
    fn shrinks_towards_its_centre_and_never_inverts() {
        let bounds = Bounds { min: Vec3::ZERO, max: Vec3::new(10.0, 4.0, 2.0) };
        assert_eq!(
            bounds.shrunk(0.25),
            Bounds { min: Vec3::new(2.5, 1.0, 0.5), max: Vec3::new(7.5, 3.0, 1.5) }
        );
        let least = bounds.shrunk(9.0);
        assert!(least.min.cmplt(least.max).all());
        assert!(bounds.contains(Vec3::ZERO) && !bounds.contains(Vec3::NEG_X));
    }

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

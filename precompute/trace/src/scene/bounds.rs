//! An axis-aligned box in world space.

use glam::Vec3;
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
}

//! A machine-independent hash of a scene.

use frugal_trace::light::Light;
use glam::Vec3;

use super::description::{Camera, Environment, Geometry, SceneDescription};

/// Fingerprint of a scene that is not a file, in bytes.
pub(crate) fn fingerprint_of(scene: &[u8]) -> String {
    Fingerprint::new().bytes(scene).digits()
}

/// FNV-1a of 128 bits (Fowler, Noll, Vo; draft-eastlake-fnv): not safe against forgery, but
/// accidental collisions are negligible.
pub(super) struct Fingerprint(u128);

impl Fingerprint {
    pub(super) fn new() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }

    /// Hashes bytes with their number, so that different sequences of parts differ.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.raw(&(bytes.len() as u64).to_le_bytes());
        self.raw(bytes)
    }

    fn raw(&mut self, bytes: &[u8]) -> &mut Self {
        for byte in bytes {
            self.0 = (self.0 ^ u128::from(*byte))
                .wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b);
        }
        self
    }

    fn numbers<const COUNT: usize>(&mut self, numbers: [f32; COUNT]) -> &mut Self {
        for number in numbers {
            // −0 and 0 are equal.
            self.raw(&(number + 0.0).to_bits().to_le_bytes());
        }
        self
    }

    fn vector(&mut self, vector: Vec3) -> &mut Self {
        self.numbers(vector.to_array())
    }

    /// 32 hexadecimal digits.
    pub(super) fn digits(&self) -> String {
        format!("{:032x}", self.0)
    }

    /// Hashes the parts of a description that affect the scene's appearance or its camera space.
    /// Destructured in full, so that a new field cannot be forgotten. Paths are left out, because a
    /// frontier map is valid for every path through its bounds, and a new tour must not need a new
    /// precomputation; the file's location is left out too.
    pub(super) fn description(&mut self, description: &SceneDescription) -> &mut Self {
        let SceneDescription {
            geometry,
            lights,
            environment,
            exposure_ev100,
            camera,
            bounds,
            paths: _,
            source: _,
        } = description;
        match geometry {
            // The file's content is hashed, not its name.
            Geometry::Gltf(_) => self.bytes(b"gltf"),
            Geometry::Procedural(name) => self.bytes(b"procedural").bytes(name.as_bytes()),
        };
        for light in lights {
            match *light {
                Light::Directional { direction, illuminance, color } => self
                    .bytes(b"directional")
                    .vector(direction)
                    .numbers([illuminance])
                    .numbers(color),
                Light::Point { position, luminous_power, range, color } => self
                    .bytes(b"point")
                    .vector(position)
                    .numbers([luminous_power, range])
                    .numbers(color),
                Light::Spot {
                    position,
                    direction,
                    luminous_power,
                    range,
                    inner_angle,
                    outer_angle,
                    color,
                } => self
                    .bytes(b"spot")
                    .vector(position)
                    .vector(direction)
                    .numbers([luminous_power, range, inner_angle, outer_angle])
                    .numbers(color),
            };
        }
        match environment {
            Environment::None => self.bytes(b"none"),
            Environment::Constant(luminance) => self.bytes(b"constant").numbers(*luminance),
            Environment::Map(_, intensity) => self.bytes(b"map").numbers([*intensity]),
        };
        let Camera { vertical_fov, near, far } = *camera;
        self.bytes(b"camera").numbers([*exposure_ev100, vertical_fov, near, far]);
        match bounds {
            None => self.bytes(b"unbounded"),
            Some(bounds) => self.bytes(b"bounds").vector(bounds.min).vector(bounds.max),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_published_function() {
        // The published value of an input of one byte, "a".
        assert_eq!(Fingerprint::new().raw(b"a").digits(), "d228cb696f1a8caf78912b704e4a8964");
    }

    #[test]
    fn parts_are_told_apart() {
        let digits = |parts: &[&[u8]]| {
            let mut fingerprint = Fingerprint::new();
            parts.iter().for_each(|part| {
                fingerprint.bytes(part);
            });
            fingerprint.digits()
        };
        assert_ne!(digits(&[b"ab", b"c"]), digits(&[b"a", b"bc"]));
        assert_eq!(
            Fingerprint::new().numbers([0.0]).digits(),
            Fingerprint::new().numbers([-0.0]).digits()
        );
    }
}

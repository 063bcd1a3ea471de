//! A machine-independent hash of a scene.

use frugal_trace::light::Light;
use frugal_trace::scene::{
    AlphaMode, SceneGeometry, SceneMaterial, SceneMesh, SceneTexture, Texels, TextureUse,
};
use glam::Vec3;

use super::description::{Camera, Environment, SceneDescription};

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
    /// precomputation; the file's location is left out too, and so is the geometry's, whose content
    /// [`geometry`](Self::geometry) hashes.
    pub(super) fn description(&mut self, description: &SceneDescription) -> &mut Self {
        let SceneDescription {
            geometry: _,
            lights,
            environment,
            exposure_ev100,
            camera,
            bounds,
            paths: _,
            source: _,
        } = description;
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

    /// Hashes geometry: each mesh with its material and textures, in whatever order they are.
    /// Destructured in full, so that a new field cannot be forgotten.
    pub(super) fn geometry(&mut self, geometry: &SceneGeometry) -> &mut Self {
        let SceneGeometry { meshes, materials, textures } = geometry;
        let textures: Vec<u128> = textures.iter().map(|each| Self::new().texture(each).0).collect();
        let materials: Vec<u128> =
            materials.iter().map(|each| Self::new().material(each, &textures).0).collect();
        let mut meshes: Vec<u128> =
            meshes.iter().map(|each| Self::new().mesh(each, &materials).0).collect();
        meshes.sort_unstable();
        self.bytes(b"geometry");
        for mesh in meshes {
            self.raw(&mesh.to_le_bytes());
        }
        self
    }

    fn mesh(&mut self, mesh: &SceneMesh, materials: &[u128]) -> &mut Self {
        let SceneMesh { positions, normals, uvs, second_uvs, colors, indices, material } = mesh;
        self.raw(&materials.get(*material).copied().unwrap_or_default().to_le_bytes());
        for (vectors, name) in [(positions, "positions"), (normals, "normals")] {
            self.bytes(name.as_bytes());
            vectors.iter().for_each(|vector| {
                self.vector(*vector);
            });
        }
        for (pairs, name) in [(uvs, "uvs"), (second_uvs, "second")] {
            self.bytes(name.as_bytes());
            pairs.iter().for_each(|pair| {
                self.numbers(pair.to_array());
            });
        }
        self.bytes(b"colors");
        colors.iter().for_each(|color| {
            self.numbers(*color);
        });
        self.bytes(b"indices");
        indices.iter().for_each(|index| {
            self.raw(&index.to_le_bytes());
        });
        self
    }

    fn material(&mut self, material: &SceneMaterial, textures: &[u128]) -> &mut Self {
        let SceneMaterial {
            base_color,
            perceptual_roughness,
            metallic,
            reflectance,
            emissive,
            alpha,
            double_sided,
            base_color_texture,
            metallic_roughness_texture,
            emissive_texture,
        } = material;
        self.numbers(*base_color).numbers([*perceptual_roughness, *metallic, *reflectance]);
        self.numbers(*emissive).raw(&[u8::from(*double_sided)]);
        match alpha {
            AlphaMode::Opaque => self.bytes(b"opaque"),
            AlphaMode::Mask(cutoff) => self.bytes(b"mask").numbers([*cutoff]),
        };
        for texture in [base_color_texture, metallic_roughness_texture, emissive_texture] {
            let Some(TextureUse { texture, second_uvs, transform }) = texture else {
                self.bytes(b"no texture");
                continue;
            };
            self.raw(&textures.get(*texture).copied().unwrap_or_default().to_le_bytes());
            self.raw(&[u8::from(*second_uvs)]).numbers(transform.to_cols_array());
        }
        self
    }

    fn texture(&mut self, texture: &SceneTexture) -> &mut Self {
        let SceneTexture { width, height, texels, wrap, filter } = texture;
        self.bytes(format!("{width}x{height} {wrap:?} {filter:?}").as_bytes());
        match texels {
            Texels::Srgb(texels) => self.bytes(b"srgb").bytes(texels.as_flattened()),
            Texels::Linear(texels) => self.bytes(b"linear").bytes(texels.as_flattened()),
            Texels::Float(texels) => {
                self.bytes(b"float");
                texels.iter().for_each(|texel| {
                    self.numbers(*texel);
                });
                self
            }
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

    #[test]
    fn geometry_counts_in_any_order() {
        let triangle = |x: f32, material| SceneMesh {
            positions: vec![Vec3::X * x, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::Z; 3],
            indices: vec![0, 1, 2],
            material,
            ..SceneMesh::default()
        };
        let glossy = SceneMaterial { perceptual_roughness: 0.2, ..SceneMaterial::default() };
        let geometry = |meshes: Vec<SceneMesh>, materials: Vec<SceneMaterial>| SceneGeometry {
            meshes,
            materials,
            textures: Vec::new(),
        };
        let digits = |geometry: &SceneGeometry| Fingerprint::new().geometry(geometry).digits();
        let plain = SceneMaterial::default();
        let one =
            geometry(vec![triangle(1.0, 0), triangle(2.0, 1)], vec![plain.clone(), glossy.clone()]);
        let other = geometry(vec![triangle(2.0, 0), triangle(1.0, 1)], vec![glossy, plain]);
        assert_eq!(digits(&one), digits(&other));
        let mut changed = one.clone();
        changed.materials[1].metallic = 1e-6;
        assert_ne!(digits(&one), digits(&changed));
        let mut changed = one.clone();
        changed.meshes[0].positions[2].x = 1e-9;
        assert_ne!(digits(&one), digits(&changed));
    }
}

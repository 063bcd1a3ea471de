//! What materials and textures are at a hit, as Bevy's shader computes it.

use glam::{DVec2, DVec3, Vec2};

use super::material::{SceneMaterial, TextureUse};
use super::mesh::SceneGeometry;
use super::rays::Hit;
use crate::color::color;

/// Values of a [valid](SceneGeometry::validate) geometry at a hit.
impl SceneGeometry {
    /// The material of `hit`.
    pub(crate) fn material(&self, hit: &Hit) -> &SceneMaterial {
        &self.materials[self.meshes[hit.triangle.mesh].material]
    }

    /// Base colour and alpha: material × vertex × texture.
    pub(crate) fn base_color(&self, hit: &Hit) -> [f64; 4] {
        let material = self.material(hit);
        let texel = self.texel(hit, material.base_color_texture);
        let colors = &self.meshes[hit.triangle.mesh].colors;
        let corners = self.corners(hit);
        std::array::from_fn(|channel| {
            let vertex = if colors.is_empty() {
                1.0
            } else {
                let of = |i: usize| f64::from(colors[corners[i]][channel]);
                (0..3).map(|i| of(i) * hit.exact_weights()[i]).sum::<f64>()
            };
            f64::from(material.base_color[channel]) * vertex * texel[channel]
        })
    }

    /// Metallic and perceptual roughness, each the material's × texture's.
    pub(crate) fn metallic_roughness(&self, hit: &Hit) -> (f64, f64) {
        let material = self.material(hit);
        let [_, green, blue, _] = self.texel(hit, material.metallic_roughness_texture);
        (f64::from(material.metallic) * blue, f64::from(material.perceptual_roughness) * green)
    }

    /// Emission, nits: the material's × texture.
    pub(crate) fn emission(&self, hit: &Hit) -> DVec3 {
        let material = self.material(hit);
        let own = color(material.emissive);
        if own == DVec3::ZERO {
            return own;
        }
        let [red, green, blue, _] = self.texel(hit, material.emissive_texture);
        own * DVec3::new(red, green, blue)
    }

    /// The texture's value; white without one.
    fn texel(&self, hit: &Hit, texture: Option<TextureUse>) -> [f64; 4] {
        let mesh = &self.meshes[hit.triangle.mesh];
        let Some(read) = texture.filter(|_| !mesh.uvs.is_empty()) else { return [1.0; 4] };
        let has_own = read.second_uvs && !mesh.second_uvs.is_empty();
        let uvs = if has_own { &mesh.second_uvs } else { &mesh.uvs };
        let weights = hit.exact_weights();
        let corners = self.corners(hit).map(|corner| uvs[corner].as_dvec2());
        let uv: DVec2 = (0..3).map(|i| corners[i] * weights[i]).sum();
        let uv: Vec2 = read.transform.as_daffine2().transform_point2(uv).as_vec2();
        self.textures[read.texture].sample(uv).map(f64::from)
    }

    /// Vertices of the triangle.
    pub(crate) fn corners(&self, hit: &Hit) -> [usize; 3] {
        let indices = &self.meshes[hit.triangle.mesh].indices;
        [0, 1, 2].map(|corner| indices[hit.triangle.index * 3 + corner] as usize)
    }
}

impl Hit {
    /// Barycentric weights of the corners; they sum to 1 in double precision.
    pub(crate) fn exact_weights(&self) -> [f64; 3] {
        let [_, second, third] = self.weights.map(f64::from);
        [1.0 - second - third, second, third]
    }
}

//! Materials in the terms of Bevy's `StandardMaterial`, and what they and textures are at a hit, as
//! Bevy's shader computes it.

use glam::{Affine2, DVec2, DVec3, Vec2};
use serde::{Deserialize, Serialize};

use super::{Hit, SceneGeometry};
use crate::color::color;

/// Interpretation of a material's alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Fragments with an alpha below this cutoff, in [0, 1], are discarded.
    Mask(f32),
}

/// How a material reads a texture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextureUse {
    /// Index into [`SceneGeometry::textures`].
    pub texture: usize,
    /// Whether it reads by the mesh's second texture coordinates; by the first where a mesh has no
    /// second ones.
    pub second_uvs: bool,
    /// From the mesh's texture coordinates to the texture's.
    pub transform: Affine2,
}

impl TextureUse {
    /// A texture read by the first texture coordinates as they are.
    pub fn plain(texture: usize) -> Self {
        Self { texture, second_uvs: false, transform: Affine2::IDENTITY }
    }
}

/// A material, in the terms of Bevy's `StandardMaterial`. A texture multiplies what it belongs to;
/// on a mesh without texture coordinates it counts as white.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneMaterial {
    /// Linear RGB reflectance and alpha, each in [0, 1]; multiplies vertex colour and texture.
    pub base_color: [f32; 4],
    /// In [0, 1]; 1 is fully rough.
    pub perceptual_roughness: f32,
    /// In [0, 1]; 0 is a dielectric.
    pub metallic: f32,
    /// Specular intensity of a dielectric in [0, 1]; 0.5 reflects 4 % at normal incidence, 0 has no
    /// specular reflection.
    pub reflectance: f32,
    /// Emitted luminance, linear RGB, nits.
    pub emissive: [f32; 3],
    /// Interpretation of alpha.
    pub alpha: AlphaMode,
    /// Whether back faces are drawn.
    pub double_sided: bool,
    /// Base colour and alpha.
    pub base_color_texture: Option<TextureUse>,
    /// Metallic in blue, roughness in green.
    pub metallic_roughness_texture: Option<TextureUse>,
    /// Emission.
    pub emissive_texture: Option<TextureUse>,
}

impl Default for SceneMaterial {
    /// A fully rough white dielectric.
    fn default() -> Self {
        Self {
            base_color: [1.0; 4],
            perceptual_roughness: 1.0,
            metallic: 0.0,
            reflectance: 0.5,
            emissive: [0.0; 3],
            alpha: AlphaMode::Opaque,
            double_sided: false,
            base_color_texture: None,
            metallic_roughness_texture: None,
            emissive_texture: None,
        }
    }
}

impl SceneMaterial {
    /// All textures that it reads.
    pub fn textures(&self) -> impl Iterator<Item = TextureUse> {
        [self.base_color_texture, self.metallic_roughness_texture, self.emissive_texture]
            .into_iter()
            .flatten()
    }
}

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

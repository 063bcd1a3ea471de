//! Materials in the terms of Bevy's `StandardMaterial`.

use glam::Affine2;
use serde::{Deserialize, Serialize};

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
    /// Index into [`SceneGeometry::textures`](super::SceneGeometry::textures).
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

//! Reflectance of surfaces, as far as the main world can read it.

use bevy::asset::{AssetId, Handle};
use bevy::color::{ColorToComponents, LinearRgba};
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::material::{AlphaMode, OpaqueRendererMethod};
use bevy::math::Vec3;
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::HashSet;

use super::cutout::{Cutout, Mask};
use super::mesh::{MeshTexture, Sides, SurfaceAssets, TextureUse, vertex_colors};
use super::points::interpolated;

/// Whether a material lets no light through except in its mask's holes.
pub(in crate::gi) fn occludes(material: &StandardMaterial) -> bool {
    is_solid(material) && material.diffuse_transmission <= 0.0
}

/// Whether a material neither blends nor refracts.
fn is_solid(material: &StandardMaterial) -> bool {
    matches!(
        material.alpha_mode,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage
    ) && material.specular_transmission <= 0.0
}

/// Whether a material is rendered into the G-buffer.
pub(in crate::gi) fn is_deferred(material: &StandardMaterial) -> bool {
    let is_meant = match material.opaque_render_method {
        // As Bevy decides; deferred is the app's default by `GiPlugin`.
        OpaqueRendererMethod::Auto => material.diffuse_transmission <= 0.0,
        method => method == OpaqueRendererMethod::Deferred,
    };
    is_meant && is_solid(material)
}

/// The reflectance of a material. A mesh reflects alike under equal reflectances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::gi) struct Reflectance {
    /// Bits, for use as a key: linear RGB, perceptual roughness, metallic, reflectance.
    values: [u32; 6],
    color: Option<TextureUse>,
    metallic_roughness: Option<TextureUse>,
    pub mask: Option<Mask>,
    pub sides: Sides,
}

/// Material parameters at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct MaterialSample {
    /// Linear RGB, each in 0 to 1.
    pub color: Vec3,
    /// Perceptual, in 0 to 1.
    pub roughness: f32,
    /// In 0 to 1.
    pub metallic: f32,
    /// Of Bevy's materials, in 0 to 1.
    pub reflectance: f32,
}

impl Reflectance {
    /// The reflectance of a material; `None` where it reflects no indirect light: unlit, (partly)
    /// transparent and forward-rendered materials.
    pub(crate) fn new(material: &StandardMaterial) -> Option<Self> {
        if material.unlit || !occludes(material) || !is_deferred(material) {
            return None;
        }
        let texture = |image: &Option<Handle<Image>>, channel| {
            Some(TextureUse::new(image.as_ref()?, channel, material.uv_transform))
        };
        let [red, green, blue, _] = material.base_color.to_linear().to_f32_array();
        Some(Self {
            values: [
                red,
                green,
                blue,
                material.perceptual_roughness,
                material.metallic,
                material.reflectance,
            ]
            .map(f32::to_bits),
            color: texture(&material.base_color_texture, &material.base_color_channel),
            metallic_roughness: texture(
                &material.metallic_roughness_texture,
                &material.metallic_roughness_channel,
            ),
            mask: Mask::new(material),
            sides: Sides::shown(material.cull_mode),
        })
    }

    /// Whether it has any of these images.
    pub(crate) fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool {
        let textures = [self.color, self.metallic_roughness];
        textures.iter().flatten().any(|texture| images.contains(&texture.image))
            || self.mask.is_some_and(|mask| mask.reads(images))
    }

    /// Whether it varies over the surface.
    pub(crate) fn is_patterned(&self) -> bool {
        self.color.is_some() || self.metallic_roughness.is_some() || self.mask.is_some()
    }

    /// Applies it to a mesh; `None` while an image cannot be read yet.
    pub(crate) fn on<'a>(
        &self,
        mesh: &'a Mesh,
        assets: &'a SurfaceAssets,
    ) -> Option<MaterialMesh<'a>> {
        let textures = assets.textures();
        Some(MaterialMesh {
            values: self.values.map(f32::from_bits),
            color: MeshTexture::new(self.color, mesh, textures)?,
            metallic_roughness: MeshTexture::new(self.metallic_roughness, mesh, textures)?,
            vertex_colors: vertex_colors(mesh),
            cutout: Cutout::new(self.mask.as_ref(), mesh, textures)?,
        })
    }
}

/// A mesh with the data that its material samples come from.
pub(in crate::gi) struct MaterialMesh<'a> {
    values: [f32; 6],
    color: Option<MeshTexture<'a>>,
    metallic_roughness: Option<MeshTexture<'a>>,
    vertex_colors: Vec<[f32; 4]>,
    cutout: Option<Cutout<'a>>,
}

/// For textures that cannot be read: an average colour, half rough, no metal.
const UNREAD_COLOR: LinearRgba = LinearRgba::rgb(0.4, 0.4, 0.4);
const UNREAD_METALLIC_ROUGHNESS: LinearRgba = LinearRgba::rgb(0.0, 0.5, 0.0);

impl MaterialMesh<'_> {
    /// The material at a point of a triangle, given by its vertex indices and barycentric weights
    /// of the second and third corner. `None` in a hole.
    pub(crate) fn at(&self, corners: [usize; 3], weights: [f32; 2]) -> Option<MaterialSample> {
        if self.cutout.as_ref().is_some_and(|cutout| !cutout.is_opaque(corners, weights)) {
            return None;
        }
        let read = |texture: &Option<MeshTexture>, unread: LinearRgba| {
            texture.as_ref().map_or(LinearRgba::WHITE, |texture| {
                texture.color(corners, weights).unwrap_or_else(|| {
                    warn_once!(
                        "neither the CPU nor a shader can read a texture: its surfaces reflect indirect light as if they were grey"
                    );
                    unread
                })
            })
        };
        let [red, green, blue, roughness, metallic, reflectance] = self.values;
        let texel = read(&self.color, UNREAD_COLOR);
        // Linear values, whatever colour space the image's format declares.
        let properties = read(&self.metallic_roughness, UNREAD_METALLIC_ROUGHNESS);
        let color =
            Vec3::new(red, green, blue) * texel.to_vec3() * self.vertex_color(corners, weights);
        // NaN compares false.
        let share = |value: f32| if value > 0.0 { value.min(1.0) } else { 0.0 };
        Some(MaterialSample {
            color: Vec3::from_array(color.to_array().map(share)),
            roughness: share(roughness * properties.green),
            metallic: share(metallic * properties.blue),
            reflectance: share(reflectance),
        })
    }

    fn vertex_color(&self, corners: [usize; 3], weights: [f32; 2]) -> Vec3 {
        let color = |corner: usize| {
            self.vertex_colors.get(corner).map_or(Vec3::ONE, |[r, g, b, _]| Vec3::new(*r, *g, *b))
        };
        interpolated(corners.map(color), weights)
    }
}

#[cfg(test)]
mod tests {
    use bevy::color::Color;
    use bevy::prelude::AlphaMode;
    use bevy::render::render_resource::Face;

    use super::*;

    #[test]
    fn unlit_and_transparent_materials_reflect_nothing() {
        let reflects = |material: StandardMaterial| Reflectance::new(&material).is_some();
        assert!(reflects(StandardMaterial::default()));
        assert!(reflects(StandardMaterial {
            alpha_mode: AlphaMode::Mask(0.5),
            ..Default::default()
        }));
        assert!(!reflects(StandardMaterial { unlit: true, ..Default::default() }));
        assert!(!reflects(StandardMaterial { alpha_mode: AlphaMode::Blend, ..Default::default() }));
        assert!(!reflects(StandardMaterial { specular_transmission: 0.5, ..Default::default() }));
        assert!(!reflects(StandardMaterial {
            opaque_render_method: OpaqueRendererMethod::Forward,
            ..Default::default()
        }));
    }

    #[test]
    fn materials_that_reflect_alike_have_one_key() {
        let red = |roughness| {
            let material = StandardMaterial {
                base_color: Color::linear_rgb(0.5, 0.1, 0.1),
                perceptual_roughness: roughness,
                ..Default::default()
            };
            Reflectance::new(&material)
        };
        assert_eq!(red(0.5), red(0.5));
        assert_ne!(red(0.5), red(0.6));
        let sided = StandardMaterial { cull_mode: Some(Face::Front), ..Default::default() };
        assert_eq!(Reflectance::new(&sided).unwrap().sides, Sides::Back);
    }

    #[test]
    fn values_out_of_range_are_clamped() {
        let mesh = Mesh::new(
            bevy::mesh::PrimitiveTopology::TriangleList,
            bevy::asset::RenderAssetUsages::all(),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0f32; 3]; 3])
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_COLOR,
            vec![[1.0f32, 0.5, 0.0, 1.0], [1.0, 0.5, 1.0, 1.0], [1.0, 0.5, 0.0, 1.0]],
        );
        let sampled = |values: [f32; 6]| {
            let mesh = MaterialMesh {
                values,
                color: None,
                metallic_roughness: None,
                vertex_colors: vertex_colors(&mesh),
                cutout: None,
            };
            mesh.at([0, 1, 2], [0.25, 0.5]).unwrap()
        };
        let sample = sampled([0.5, 0.5, 0.5, 0.7, 0.2, 0.5]);
        assert_eq!(
            (sample.color, sample.roughness, sample.metallic),
            (Vec3::new(0.5, 0.25, 0.125), 0.7, 0.2)
        );
        for odd in [f32::NAN, f32::INFINITY, -1.0, 1e30] {
            let sample = sampled([odd; 6]);
            let values = [
                sample.color.x,
                sample.color.y,
                sample.color.z,
                sample.roughness,
                sample.metallic,
                sample.reflectance,
            ];
            assert!(values.iter().all(|value| (0.0..=1.0).contains(value)), "{odd}: {sample:?}");
        }
    }
}

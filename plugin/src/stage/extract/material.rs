//! `StandardMaterial` as a path tracer's.

use std::collections::HashMap;

use bevy::asset::{AssetId, Assets, Handle};
use bevy::color::{ColorToComponents, LinearRgba};
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::mesh::UvChannel;
use bevy::pbr::StandardMaterial;
use bevy::prelude::AlphaMode as BevyAlpha;
use frugal_trace::scene::{AlphaMode, SceneMaterial, SceneTexture, TextureUse};

use super::Gaps;
use super::texture::texture;

/// Materials and textures, each converted once.
#[derive(Default)]
pub(super) struct Materials {
    pub(super) materials: Vec<SceneMaterial>,
    pub(super) textures: Vec<SceneTexture>,
    known: HashMap<AssetId<StandardMaterial>, usize>,
    images: HashMap<AssetId<Image>, Option<usize>>,
    grey: Option<usize>,
}

impl Materials {
    /// Index of the material of the surface called `name`, or why that is left out: light then passes, as
    /// in the renderer's global illumination, which knows no transparency. `exposure` is the factor from
    /// nits to the renderer's units.
    pub(super) fn convert(
        &mut self,
        world: &World,
        (id, material): (AssetId<StandardMaterial>, &StandardMaterial),
        exposure: f32,
        name: &str,
        gaps: &mut Gaps,
    ) -> Result<usize, &'static str> {
        if material.specular_transmission > 0.0 {
            return Err("transmissive surfaces are left out, so that light passes them");
        }
        match material.alpha_mode {
            BevyAlpha::Opaque | BevyAlpha::Mask(_) | BevyAlpha::AlphaToCoverage => {}
            BevyAlpha::Blend | BevyAlpha::Premultiplied | BevyAlpha::Add | BevyAlpha::Multiply => {
                return Err("blended surfaces are left out, so that light passes them");
            }
        }
        name_gaps(material, name, gaps);
        if let Some(index) = self.known.get(&id) {
            return Ok(*index);
        }
        let converted = self.standard(world, material, exposure, name, gaps);
        self.materials.push(converted);
        let index = self.materials.len() - 1;
        self.known.insert(id, index);
        Ok(index)
    }

    /// Index of the material that stands for those whose shaders are not known.
    pub(super) fn grey(&mut self) -> usize {
        *self.grey.get_or_insert_with(|| {
            self.materials.push(SceneMaterial {
                base_color: [0.5, 0.5, 0.5, 1.0],
                ..SceneMaterial::default()
            });
            self.materials.len() - 1
        })
    }

    fn standard(
        &mut self,
        world: &World,
        material: &StandardMaterial,
        exposure: f32,
        name: &str,
        gaps: &mut Gaps,
    ) -> SceneMaterial {
        let alpha = match material.alpha_mode {
            BevyAlpha::Mask(cutoff) => AlphaMode::Mask(unit(cutoff)),
            BevyAlpha::AlphaToCoverage => AlphaMode::Mask(0.5),
            _ => AlphaMode::Opaque,
        };
        let mut read = |texture: &Option<Handle<Image>>, channel: &UvChannel| {
            let index = self.texture(world, texture.as_ref()?, name, gaps)?;
            let second_uvs = matches!(channel, UvChannel::Uv1);
            Some(TextureUse { texture: index, second_uvs, transform: material.uv_transform })
        };
        let base_color_texture = read(&material.base_color_texture, &material.base_color_channel);
        let base_color = LinearRgba::from(material.base_color).to_f32_array().map(unit);
        let double_sided = material.cull_mode.is_none();
        if material.unlit {
            // Its colour is light of no unit, which it sends to the camera alone.
            let base_color = [0.0, 0.0, 0.0, base_color[3]];
            let reflectance = 0.0;
            return SceneMaterial {
                base_color,
                reflectance,
                alpha,
                double_sided,
                base_color_texture,
                ..SceneMaterial::default()
            };
        }
        // An emission of weight 0 is in the renderer's units, one of weight 1 in nits.
        let weight = material.emissive_exposure_weight;
        let nits = weight + (1.0 - weight) / exposure;
        let emissive = [material.emissive.red, material.emissive.green, material.emissive.blue];
        SceneMaterial {
            base_color,
            perceptual_roughness: unit(material.perceptual_roughness),
            metallic: unit(material.metallic),
            reflectance: unit(material.reflectance),
            emissive: emissive.map(|value| {
                let value = value * nits;
                if value.is_finite() { value.max(0.0) } else { 0.0 }
            }),
            alpha,
            double_sided,
            base_color_texture,
            metallic_roughness_texture: read(
                &material.metallic_roughness_texture,
                &material.metallic_roughness_channel,
            ),
            emissive_texture: read(&material.emissive_texture, &material.emissive_channel),
        }
    }

    /// Index of an image's texture; `None` of one that cannot be read.
    fn texture(
        &mut self,
        world: &World,
        image: &Handle<Image>,
        name: &str,
        gaps: &mut Gaps,
    ) -> Option<usize> {
        *self.images.entry(image.id()).or_insert_with(|| {
            let loaded = world.get_resource::<Assets<Image>>().and_then(|all| all.get(image));
            match loaded.map_or(Err("images that are not loaded are read as white"), texture) {
                Ok(texture) => {
                    self.textures.push(texture);
                    Some(self.textures.len() - 1)
                }
                Err(problem) => {
                    let path = image.path().map(|path| format!(" ({path})")).unwrap_or_default();
                    gaps.add(problem, format!("{name}{path}"));
                    None
                }
            }
        })
    }
}

/// Properties of a material that have no counterpart.
fn name_gaps(material: &StandardMaterial, name: &str, gaps: &mut Gaps) {
    let is_tinted = LinearRgba::from(material.specular_tint) != LinearRgba::WHITE;
    for (is_there, what) in [
        (material.normal_map_texture.is_some(), "normal maps are not traced"),
        (material.depth_map.is_some(), "depth maps are not traced"),
        (material.occlusion_texture.is_some(), "occlusion maps are not traced"),
        (material.clearcoat > 0.0, "clearcoats are not traced"),
        (material.anisotropy_strength != 0.0, "anisotropy is not traced"),
        (material.diffuse_transmission > 0.0, "diffuse transmission is not traced"),
        (is_tinted, "specular tints are not traced"),
        (material.unlit, "unlit surfaces are traced as black"),
        (
            material.cull_mode.is_none() && !material.double_sided,
            "backs that are lit as their fronts are traced as double-sided",
        ),
        (
            material.alpha_mode == BevyAlpha::AlphaToCoverage,
            "alpha to coverage is traced as a mask of 0.5",
        ),
    ] {
        if is_there {
            gaps.add(what, name);
        }
    }
}

/// Clamps to [0, 1].
fn unit(value: f32) -> f32 {
    if value.is_finite() { value.clamp(0.0, 1.0) } else { 0.0 }
}

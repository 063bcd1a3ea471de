//! Alpha masks on meshes, as far as the main world can read them.

use bevy::asset::AssetId;
use bevy::color::Alpha;
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::material::AlphaMode;
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::HashSet;

use super::copies::Textures;
use super::mesh::{MeshTexture, TextureUse, vertex_colors};
use super::points::interpolated;

/// A material's alpha mask. A mesh has the same holes under equal masks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(in crate::gi) struct Mask {
    texture: Option<TextureUse>,
    /// Bits of the base colour's alpha and of the cutoff, for use as a key.
    alpha: u32,
    cutoff: u32,
}

impl Mask {
    /// The mask of a material; `None` where it cannot have holes.
    pub(crate) fn new(material: &StandardMaterial) -> Option<Self> {
        let cutoff = match material.alpha_mode {
            AlphaMode::Mask(cutoff) => cutoff,
            // As Bevy 0.19 renders it without multisampling.
            AlphaMode::AlphaToCoverage => 0.5,
            _ => return None,
        };
        // With a cutoff of NaN, everything is a hole.
        if cutoff <= 0.0 {
            return None;
        }
        let texture = material.base_color_texture.as_ref();
        Some(Self {
            texture: texture.map(|image| {
                TextureUse::new(image, &material.base_color_channel, material.uv_transform)
            }),
            alpha: material.base_color.alpha().to_bits(),
            cutoff: cutoff.to_bits(),
        })
    }

    /// Whether it has any of these images.
    pub(crate) fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool {
        self.texture.is_some_and(|texture| images.contains(&texture.image))
    }
}

/// A mask on a mesh, with the data for evaluating it.
pub(in crate::gi) struct Cutout<'a> {
    /// Of the material.
    alpha: f32,
    cutoff: f32,
    texture: Option<MeshTexture<'a>>,
    /// Alpha of the mesh's vertices; empty for 1.
    corner_alpha: Vec<f32>,
}

impl<'a> Cutout<'a> {
    /// `None` while the mask's image is not there, and `Some(None)` without a mask.
    pub(crate) fn new(
        mask: Option<&Mask>,
        mesh: &'a Mesh,
        textures: Textures<'a>,
    ) -> Option<Option<Self>> {
        let Some(mask) = mask else { return Some(None) };
        let texture = MeshTexture::new(mask.texture, mesh, textures)?;
        if texture.as_ref().is_some_and(|texture| !texture.is_readable()) {
            warn_once!(
                "neither the CPU nor a shader can read the texture of an alpha mask: its surfaces occlude indirect light as if they had no holes"
            );
        }
        let texture = texture.filter(MeshTexture::is_readable);
        let corner_alpha = vertex_colors(mesh).into_iter().map(|[.., alpha]| alpha).collect();
        Some(Some(Self {
            alpha: f32::from_bits(mask.alpha),
            cutoff: f32::from_bits(mask.cutoff),
            texture,
            corner_alpha,
        }))
    }

    /// With copies of all borrowed data, for evaluation in the background.
    pub(crate) fn into_owned(self) -> Cutout<'static> {
        Cutout { texture: self.texture.map(MeshTexture::into_owned), ..self }
    }

    /// Whether a triangle, given by its vertex indices, may have holes.
    pub(crate) fn may_pierce(&self, corners: [usize; 3]) -> bool {
        self.texture.is_some()
            || !corners.iter().all(|corner| self.alpha_of(*corner) >= self.cutoff)
    }

    /// Whether the triangle is opaque at a point: barycentric weights of its second and third
    /// corner.
    pub(crate) fn is_opaque(&self, corners: [usize; 3], weights: [f32; 2]) -> bool {
        let alpha = interpolated(corners.map(|corner| self.alpha_of(corner)), weights);
        let texel = self
            .texture
            .as_ref()
            .and_then(|texture| texture.color(corners, weights))
            .map_or(1.0, |color| color.alpha);
        // NaN compares false, and is a hole in Bevy's rendering, too.
        alpha * texel >= self.cutoff
    }

    fn alpha_of(&self, corner: usize) -> f32 {
        self.alpha * self.corner_alpha.get(corner).copied().unwrap_or(1.0)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use bevy::asset::{Assets, RenderAssetUsages};
    use bevy::color::Color;
    use bevy::math::{Affine2, Vec2};
    use bevy::mesh::PrimitiveTopology;
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    use super::*;
    use crate::gi::surfaces::copies::GiTextureCopies;

    const CORNERS: [usize; 3] = [0, 1, 2];

    fn triangle() -> Mesh {
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_POSITION,
                vec![[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            )
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_UV_0,
                vec![[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0]],
            )
    }

    /// A texture whose left half is clear.
    fn half_clear() -> Image {
        let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
        Image::new(
            size,
            TextureDimension::D2,
            vec![255, 255, 255, 0, 255, 255, 255, 255],
            TextureFormat::Rgba8Unorm,
            RenderAssetUsages::all(),
        )
    }

    fn masked(alpha_mode: AlphaMode) -> StandardMaterial {
        StandardMaterial { alpha_mode, ..Default::default() }
    }

    /// Of an app without a renderer.
    fn textures(images: &Assets<Image>) -> Textures<'_> {
        static COPIES: LazyLock<GiTextureCopies> = LazyLock::new(GiTextureCopies::default);
        Textures { images: Some(images), copies: &COPIES }
    }

    fn cutout<'a>(
        material: &StandardMaterial,
        mesh: &'a Mesh,
        images: &'a Assets<Image>,
    ) -> Cutout<'a> {
        let mask = Mask::new(material).unwrap();
        Cutout::new(Some(&mask), mesh, textures(images)).unwrap().unwrap()
    }

    #[test]
    fn only_masks_with_a_positive_cutoff_have_holes() {
        for alpha_mode in [
            AlphaMode::Opaque,
            AlphaMode::Blend,
            AlphaMode::Mask(0.0),
            AlphaMode::Mask(-1.0),
            AlphaMode::Mask(f32::NEG_INFINITY),
        ] {
            assert_eq!(Mask::new(&masked(alpha_mode)), None, "{alpha_mode:?}");
        }
        let images = Assets::default();
        for (alpha_mode, alpha, there) in [
            (AlphaMode::Mask(0.5), 0.5, true),
            (AlphaMode::Mask(0.5), 0.49, false),
            (AlphaMode::AlphaToCoverage, 0.5, true),
            (AlphaMode::AlphaToCoverage, 0.49, false),
            (AlphaMode::Mask(f32::NAN), 1.0, false),
            (AlphaMode::Mask(f32::INFINITY), 1.0, false),
            (AlphaMode::Mask(0.5), f32::NAN, false),
        ] {
            let material = StandardMaterial {
                base_color: Color::linear_rgba(1.0, 1.0, 1.0, alpha),
                ..masked(alpha_mode)
            };
            let triangle = triangle();
            let cutout = cutout(&material, &triangle, &images);
            assert_eq!(cutout.is_opaque(CORNERS, [0.2, 0.2]), there, "{alpha_mode:?} {alpha}");
            assert_eq!(
                cutout.may_pierce(CORNERS),
                !there,
                "no test is needed: {alpha_mode:?} {alpha}"
            );
        }
    }

    #[test]
    fn alpha_of_texture_vertices_and_material_multiplies() {
        let mut images = Assets::default();
        let texture = images.add(half_clear());
        let material =
            StandardMaterial { base_color_texture: Some(texture), ..masked(AlphaMode::Mask(0.5)) };
        let left_and_right = |material: &StandardMaterial, mesh: &Mesh| {
            let cutout = cutout(material, mesh, &images);
            [0.2, 0.7].map(|across| cutout.is_opaque(CORNERS, [across, 0.2]))
        };
        assert_eq!(left_and_right(&material, &triangle()), [false, true]);
        let turned = StandardMaterial {
            uv_transform: Affine2::from_translation(Vec2::new(-7.5, 3.0)),
            ..material.clone()
        };
        assert_eq!(left_and_right(&turned, &triangle()), [true, false], "repeats");
        let mut faded = triangle();
        faded.insert_attribute(
            Mesh::ATTRIBUTE_COLOR,
            vec![[1.0f32; 4], [1.0, 1.0, 1.0, 0.2], [1.0; 4]],
        );
        assert_eq!(left_and_right(&material, &faded), [false, false]);
        assert!(
            cutout(&material, &faded, &images).is_opaque(CORNERS, [0.55, 0.2]),
            "less towards the second corner"
        );
        let mut bare = triangle();
        bare.remove_attribute(Mesh::ATTRIBUTE_UV_0);
        assert_eq!(
            left_and_right(&material, &bare),
            [true, true],
            "Bevy reads no texture without coordinates"
        );
    }

    #[test]
    fn a_texture_that_is_missing_is_waited_for_and_one_that_cannot_be_read_has_no_holes() {
        let mut images = Assets::<Image>::default();
        let later = images.reserve_handle();
        let material =
            StandardMaterial { base_color_texture: Some(later), ..masked(AlphaMode::Mask(0.5)) };
        assert!(
            Cutout::new(Mask::new(&material).as_ref(), &triangle(), textures(&images)).is_none()
        );
        let unread = images.add(Image { data: None, ..half_clear() });
        let material =
            StandardMaterial { base_color_texture: Some(unread), ..masked(AlphaMode::Mask(0.5)) };
        assert!(!cutout(&material, &triangle(), &images).may_pierce(CORNERS));
    }
}

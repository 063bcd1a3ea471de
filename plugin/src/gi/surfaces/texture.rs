//! Texture mapping and texture reads, as far as the main world can read images.

use std::borrow::Cow;

use bevy::asset::{AssetId, Handle};
use bevy::color::LinearRgba;
use bevy::image::Image;
use bevy::math::{Affine2, Vec2};
use bevy::mesh::{Mesh, MeshVertexAttribute, UvChannel, VertexAttributeValues};

use super::copies::{Textures, is_readable};
use super::points::interpolated;

/// The mapping of a texture onto a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::gi) struct TextureUse {
    pub image: AssetId<Image>,
    /// Whether it uses the second set of coordinates.
    second: bool,
    /// Bits of the matrix by columns, for use as a key.
    transform: [u32; 6],
}

impl TextureUse {
    /// A material's texture, by its channel and `uv_transform`.
    pub(crate) fn new(image: &Handle<Image>, channel: &UvChannel, transform: Affine2) -> Self {
        Self {
            image: image.id(),
            second: *channel == UvChannel::Uv1,
            transform: transform.to_cols_array().map(f32::to_bits),
        }
    }

    /// The mesh's coordinates for it. Bevy reads no texture where there are none.
    fn coordinates(self, mesh: &Mesh) -> Option<&[[f32; 2]]> {
        let attribute: MeshVertexAttribute =
            if self.second { Mesh::ATTRIBUTE_UV_1 } else { Mesh::ATTRIBUTE_UV_0 };
        match mesh.try_attribute_option(attribute).ok()?? {
            VertexAttributeValues::Float32x2(coordinates) => Some(coordinates),
            _ => None,
        }
    }
}

/// A texture on a mesh.
#[derive(Clone, Debug)]
pub(in crate::gi) struct MeshTexture<'a> {
    image: Cow<'a, Image>,
    coordinates: Cow<'a, [[f32; 2]]>,
    /// From the mesh's coordinates to the texture's.
    transform: Affine2,
}

impl<'a> MeshTexture<'a> {
    /// A texture on `mesh`: `None` while it cannot be read yet, and `Some(None)` where there is no
    /// texture, or the mesh has no coordinates for it.
    pub(crate) fn new(
        texture: Option<TextureUse>,
        mesh: &'a Mesh,
        textures: Textures<'a>,
    ) -> Option<Option<Self>> {
        let Some(texture) = texture else { return Some(None) };
        let image = textures.get(texture.image)?;
        let transform = Affine2::from_cols_array(&texture.transform.map(f32::from_bits));
        let on_mesh = |coordinates| Self {
            image: Cow::Borrowed(image),
            coordinates: Cow::Borrowed(coordinates),
            transform,
        };
        Some(texture.coordinates(mesh).map(on_mesh))
    }

    /// With copies of all borrowed data.
    pub(crate) fn into_owned(self) -> MeshTexture<'static> {
        let Self { image, coordinates, transform } = self;
        MeshTexture {
            image: Cow::Owned(image.into_owned()),
            coordinates: Cow::Owned(coordinates.into_owned()),
            transform,
        }
    }

    /// Whether the CPU can read the image.
    pub(crate) fn is_readable(&self) -> bool {
        is_readable(&self.image)
    }

    /// Linear colour at a point of a triangle, given by its vertex indices and barycentric weights
    /// of the second and third corner. `None` where the CPU cannot read it.
    pub(crate) fn color(&self, corners: [usize; 3], weights: [f32; 2]) -> Option<LinearRgba> {
        // Vertices without coordinates have (0, 0).
        let coordinates = corners
            .map(|corner| self.coordinates.get(corner).copied().map_or(Vec2::ZERO, Vec2::from));
        texel(&self.image, self.transform.transform_point2(interpolated(coordinates, weights)))
    }
}

/// Linear colour of the texel at `uv`; `None` where the CPU cannot read it.
fn texel(image: &Image, uv: Vec2) -> Option<LinearRgba> {
    let (width, height) = (image.width().max(1), image.height().max(1));
    // Repeats outside the unit square.
    let texel = (uv - uv.floor()) * Vec2::new(width as f32, height as f32);
    let (x, y) = ((texel.x as u32).min(width - 1), (texel.y as u32).min(height - 1));
    image.get_color_at(x, y).ok().map(|color| color.to_linear())
}

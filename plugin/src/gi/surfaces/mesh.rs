//! Mesh assets and their textures as far as the main world can read them: triangles, vertex colours,
//! visible sides, texels.

use std::borrow::Cow;

use bevy::asset::{AssetId, Assets, Handle};
use bevy::color::LinearRgba;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::math::{Affine2, Vec2, Vec3};
use bevy::mesh::{Mesh, PrimitiveTopology, UvChannel, VertexAttributeValues};
use bevy::pbr::StandardMaterial;
use bevy::render::render_resource::Face;

use super::copies::{GiTextureCopies, Textures, is_readable};
use super::points::interpolated;

/// For systems that read surfaces in the main world.
#[derive(SystemParam)]
pub(in crate::gi) struct SurfaceAssets<'w> {
    pub meshes: Res<'w, Assets<Mesh>>,
    /// `None` in an app without images.
    images: Option<Res<'w, Assets<Image>>>,
    /// `None` in an app without Bevy's materials.
    pub materials: Option<Res<'w, Assets<StandardMaterial>>>,
    copies: Res<'w, GiTextureCopies>,
}

impl SurfaceAssets<'_> {
    pub(crate) fn textures(&self) -> Textures<'_> {
        Textures { images: self.images.as_deref(), copies: &self.copies }
    }
}

/// Triangles in the mesh's own space.
pub(in crate::gi) struct Triangles {
    /// Vertex indices of each triangle's corners.
    pub corners: Vec<[usize; 3]>,
    /// Positions of these corners, metres.
    pub positions: Vec<[Vec3; 3]>,
}

/// A mesh's triangles; `None` where the asset is kept for the GPU alone or is no triangle list.
/// Triangles with indices past the last vertex are left out.
pub(in crate::gi) fn triangles(mesh: &Mesh) -> Option<Triangles> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return None;
    }
    let VertexAttributeValues::Float32x3(positions) =
        mesh.try_attribute_option(Mesh::ATTRIBUTE_POSITION).ok()??
    else {
        return None;
    };
    let is_there = |corners: &[usize; 3]| corners.iter().all(|corner| *corner < positions.len());
    let corners: Vec<[usize; 3]> = match mesh.try_indices_option().ok()? {
        None => (0..positions.len() / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        Some(indices) => {
            let indices: Vec<usize> = indices.iter().collect();
            indices.as_chunks::<3>().0.iter().copied().filter(is_there).collect()
        }
    };
    let place = |corner: usize| Vec3::from(positions[corner]);
    let positions = corners.iter().map(|triangle| triangle.map(place)).collect();
    Some(Triangles { corners, positions })
}

/// Linear RGBA of each vertex; empty where the mesh has none in a format that Bevy's materials
/// read.
pub(super) fn vertex_colors(mesh: &Mesh) -> Vec<[f32; 4]> {
    match mesh.try_attribute_option(Mesh::ATTRIBUTE_COLOR).ok().flatten() {
        Some(VertexAttributeValues::Float32x4(colors)) => colors.clone(),
        Some(VertexAttributeValues::Unorm8x4(colors)) => {
            colors.iter().map(|color| color.map(|byte| f32::from(byte) / 255.0)).collect()
        }
        Some(VertexAttributeValues::Unorm16x4(colors)) => {
            colors.iter().map(|color| color.map(|part| f32::from(part) / 65535.0)).collect()
        }
        _ => Vec::new(),
    }
}

/// Visible sides of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::gi) enum Sides {
    /// The side from which triangles run counter-clockwise.
    Front,
    /// The other one.
    Back,
    /// Either.
    Both,
}

impl Sides {
    /// The sides that a material shows when it culls these faces.
    pub(crate) fn shown(culled: Option<Face>) -> Self {
        match culled {
            Some(Face::Back) => Self::Front,
            Some(Face::Front) => Self::Back,
            None => Self::Both,
        }
    }

    /// Signs of their normals.
    pub(crate) fn signs(self) -> &'static [f32] {
        match self {
            Self::Front => &[1.0],
            Self::Back => &[-1.0],
            Self::Both => &[1.0, -1.0],
        }
    }
}

/// The mapping of a texture onto a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
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
        let attribute = if self.second { Mesh::ATTRIBUTE_UV_1 } else { Mesh::ATTRIBUTE_UV_0 };
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

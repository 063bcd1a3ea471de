//! A mesh asset as far as the main world can read it: triangles, vertex colours, visible sides.

use bevy::math::Vec3;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};
use bevy::render::render_resource::Face;

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
        Some(Indices::U16(indices)) => {
            indices.as_chunks::<3>().0.iter().map(|i| i.map(usize::from)).filter(is_there).collect()
        }
        Some(Indices::U32(indices)) => indices
            .as_chunks::<3>()
            .0
            .iter()
            .map(|i| i.map(|i| i as usize))
            .filter(is_there)
            .collect(),
    };
    let positions = corners
        .iter()
        .map(|triangle| triangle.map(|corner| Vec3::from(positions[corner])))
        .collect();
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

    /// Number of sides.
    pub(crate) fn count(self) -> usize {
        self.signs().len()
    }
}

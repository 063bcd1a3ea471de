//! The triangles of a mesh asset, as far as the main world can read them.

use bevy::math::Vec3;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};

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

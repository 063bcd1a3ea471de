//! The triangles of a mesh asset, as far as the main world can read them.

use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};

/// Positions in the mesh's own space, and each triangle's three places among them; `None` where the asset is kept for the GPU alone or is no
/// triangle list. Triangles that point past the last position are left out.
pub(super) fn read(mesh: &Mesh) -> Option<(&[[f32; 3]], Vec<[usize; 3]>)> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
        return None;
    }
    let VertexAttributeValues::Float32x3(positions) = mesh.try_attribute_option(Mesh::ATTRIBUTE_POSITION).ok()?? else { return None };
    let is_there = |corners: &[usize; 3]| corners.iter().all(|corner| *corner < positions.len());
    let corners = match mesh.try_indices_option().ok()? {
        None => (0..positions.len() / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        Some(Indices::U16(indices)) => indices.as_chunks::<3>().0.iter().map(|i| i.map(usize::from)).filter(is_there).collect(),
        Some(Indices::U32(indices)) => indices.as_chunks::<3>().0.iter().map(|i| i.map(|i| i as usize)).filter(is_there).collect(),
    };
    Some((positions, corners))
}

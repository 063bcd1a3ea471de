//! Vertex colours of a mesh.

use bevy::mesh::{Mesh, VertexAttributeValues};

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

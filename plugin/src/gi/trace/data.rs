//! What rays traverse, as the GPU holds it.

use bevy::log::warn_once;
use bevy::math::{Affine3A, Vec3A};
use bytemuck::{Pod, Zeroable};

use super::bvh::MeshBvh;

/// `trace/trace.wgsl`'s `Instance`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Instance {
    /// Rows of the matrix from the world to the mesh.
    pub local_from_world: [[f32; 4]; 3],
    /// The mesh's first node and the one after its last.
    pub nodes: [u32; 2],
    pub padding: [u32; 2],
}

/// An instance of a mesh's tree, and its box; `None` where it is scaled to nothing or out of the
/// range of floats, and occludes nothing.
pub(super) fn instance(
    tree: &MeshBvh,
    nodes: [u32; 2],
    affine: &Affine3A,
) -> Option<(Instance, (Vec3A, Vec3A))> {
    let inverse = affine.inverse();
    let bounds = tree.bounds(affine).filter(|_| inverse.is_finite())?;
    let [x, y, z] = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis]
        .map(|axis| axis.to_array());
    let offset = inverse.translation.to_array();
    let local_from_world = std::array::from_fn(|row| [x[row], y[row], z[row], offset[row]]);
    Some((Instance { local_from_world, nodes, padding: [0; 2] }, bounds))
}

/// Warns once that there is no room for more.
pub(super) fn warn_of_full_buffer() {
    warn_once!(
        "the scene's meshes exceed this GPU's largest storage buffer: those that are left out occlude no indirect light"
    );
}

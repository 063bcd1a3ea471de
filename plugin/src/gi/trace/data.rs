//! What rays traverse, as the GPU holds it.

use bevy::log::warn_once;
use bevy::math::{Affine3A, Vec3A};
use bytemuck::{Pod, Zeroable};

use super::bvh::{MeshBvh, Node, TriangleWords};

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

/// Trees of all meshes, one after another.
#[derive(Debug, Default)]
pub(super) struct MeshData {
    pub nodes: Vec<Node>,
    pub triangles: Vec<TriangleWords>,
    /// Whether any triangle has holes.
    pub is_masked: bool,
}

/// Instances of meshes, and the tree over them.
#[derive(Clone, Debug, Default)]
pub(super) struct InstanceData {
    pub nodes: Vec<Node>,
    pub instances: Vec<Instance>,
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

/// Whether `count` more items fit behind those of `items` in a buffer of `most` bytes; warns once
/// if not.
pub(super) fn fits<T>(items: &[T], count: usize, most: usize) -> bool {
    let fits = (items.len() + count) * size_of::<T>() <= most;
    if !fits {
        warn_of_full_buffer();
    }
    fits
}

/// Warns once.
pub(super) fn warn_of_full_buffer() {
    warn_once!(
        "the scene's meshes exceed this GPU's largest storage buffer: those that are left out occlude no indirect light"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exceeds_the_largest_buffer_is_left_out() {
        assert!(fits(&[0u32; 3], 1, 16) && !fits(&[0u32; 3], 2, 16) && fits::<u32>(&[], 0, 0));
    }
}

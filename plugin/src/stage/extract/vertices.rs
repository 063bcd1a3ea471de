//! A mesh's vertices where they are drawn: morphed, skinned and placed as by Bevy's vertex shader.
//!
//! In double precision, so that every machine finds the same single-precision positions.

use bevy::math::{DMat3, DMat4, DVec3, Vec2, Vec3};
use bevy::mesh::{Indices, Mesh, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues};
use frugal_trace::scene::SceneMesh;

/// Where a mesh is drawn.
pub(super) enum Placement {
    /// By its entity's transform.
    Rigid(DMat4),
    /// By its joints: joint's transform × inverse bind pose.
    Skinned(Vec<DMat4>),
}

/// Which sides of a mesh are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    Fronts,
    Backs,
    Both,
}

/// The mesh in world space; its front sides are those that are drawn. Why it cannot be read
/// otherwise.
pub(super) fn scene_mesh(
    mesh: &Mesh,
    placement: &Placement,
    weights: &[f32],
    drawn: Drawn,
    material: usize,
) -> Result<SceneMesh, &'static str> {
    let attribute = |attribute: MeshVertexAttribute| -> Result<_, &'static str> {
        let gpu_only = |_| "meshes kept for the GPU alone are left out";
        Ok(mesh.try_attribute_option(attribute).map_err(gpu_only)?.and_then(floats))
    };
    let Some(positions) = attribute(Mesh::ATTRIBUTE_POSITION)? else {
        return Err("meshes without positions are left out");
    };
    let count = positions.len();
    let complete = |found: Option<Vec<[f32; 4]>>| found.filter(|found| found.len() == count);
    let mut positions: Vec<DVec3> = positions.iter().map(xyz).collect();
    // Without normals those of the triangles count.
    let mut normals: Vec<DVec3> = complete(attribute(Mesh::ATTRIBUTE_NORMAL)?)
        .map_or(vec![DVec3::ZERO; count], |normals| normals.iter().map(xyz).collect());
    for (target, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
        let weight = f64::from(*weight);
        let targets = mesh.try_morph_targets().map_or(&[][..], Vec::as_slice);
        let offsets = targets.chunks_exact(count.max(1)).nth(target).unwrap_or_default();
        for (vertex, offset) in offsets.iter().enumerate() {
            positions[vertex] += offset.position.as_dvec3() * weight;
            normals[vertex] += offset.normal.as_dvec3() * weight;
        }
    }
    let joints = complete(attribute(Mesh::ATTRIBUTE_JOINT_INDEX)?)
        .zip(complete(attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT)?));
    let mut mirrored = false;
    match (placement, joints) {
        (Placement::Skinned(matrices), Some((indices, shares))) => {
            for vertex in 0..count {
                let joint = |i: usize| {
                    let matrix = matrices.get(indices[vertex][i] as usize);
                    matrix.map_or(DMat4::ZERO, |matrix| *matrix * f64::from(shares[vertex][i]))
                };
                let matrix = joint(0) + joint(1) + joint(2) + joint(3);
                mirrored = place(&matrix, &mut positions[vertex], &mut normals[vertex]);
            }
        }
        (Placement::Rigid(matrix), _) => {
            for (position, normal) in positions.iter_mut().zip(&mut normals) {
                mirrored = place(matrix, position, normal);
            }
        }
        (Placement::Skinned(_), None) => return Err("skinned meshes without joints are left out"),
    }
    let positions: Vec<Vec3> = positions.iter().map(|position| position.as_vec3()).collect();
    if !positions.iter().all(|position| position.is_finite()) {
        return Err("meshes with positions that are not finite are left out");
    }
    let mut indices = triangles(mesh, count)?;
    if drawn == Drawn::Backs || (drawn == Drawn::Both && mirrored) {
        indices.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
    }
    let uvs = |found: Option<Vec<[f32; 4]>>| -> Vec<Vec2> {
        found.unwrap_or_default().iter().map(|uv| Vec2::new(uv[0], uv[1])).collect()
    };
    Ok(SceneMesh {
        positions,
        normals: normals.iter().map(|normal| normal.as_vec3()).collect(),
        uvs: uvs(complete(attribute(Mesh::ATTRIBUTE_UV_0)?)),
        second_uvs: uvs(complete(attribute(Mesh::ATTRIBUTE_UV_1)?)),
        colors: complete(attribute(Mesh::ATTRIBUTE_COLOR)?).unwrap_or_default(),
        indices,
        material,
    })
}

fn xyz(value: &[f32; 4]) -> DVec3 {
    DVec3::new(value[0].into(), value[1].into(), value[2].into())
}

/// Moves a vertex; returns whether `matrix` mirrors.
fn place(matrix: &DMat4, position: &mut DVec3, normal: &mut DVec3) -> bool {
    *position = matrix.transform_point3(*position);
    let linear = DMat3::from_mat4(*matrix);
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    // The cofactors transform normals without an inverse, and so handle singular transforms.
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let determinant = x.dot(y.cross(z));
    *normal = (cofactors * *normal * determinant.signum()).normalize_or_zero();
    determinant < 0.0
}

/// Three valid indices per triangle.
fn triangles(mesh: &Mesh, count: usize) -> Result<Vec<u32>, &'static str> {
    let order: Vec<u32> = match mesh.try_indices_option() {
        Err(_) => return Err("meshes kept for the GPU alone are left out"),
        Ok(Some(Indices::U16(indices))) => indices.iter().map(|index| u32::from(*index)).collect(),
        Ok(Some(Indices::U32(indices))) => indices.clone(),
        Ok(None) => (0..count as u32).collect(),
    };
    if order.iter().any(|index| *index as usize >= count) {
        return Err("meshes with indices out of range are left out");
    }
    match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => Ok(order[..order.len() / 3 * 3].to_vec()),
        PrimitiveTopology::TriangleStrip => Ok(order
            .windows(3)
            .enumerate()
            .flat_map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect()),
        _ => Err("points and lines are left out"),
    }
}

/// Values as a shader reads them, without a fourth component 1; `None` of formats that Bevy's attributes
/// do not have, but for colours in bytes.
pub(super) fn floats(values: &VertexAttributeValues) -> Option<Vec<[f32; 4]>> {
    use VertexAttributeValues::*;
    fn each<T: Copy, const N: usize>(values: &[[T; N]], value: impl Fn(T) -> f32) -> Vec<[f32; 4]> {
        let padded = |from: &[T; N]| {
            let mut to = [0.0, 0.0, 0.0, 1.0];
            to.iter_mut().zip(from).for_each(|(to, from)| *to = value(*from));
            to
        };
        values.iter().map(padded).collect()
    }
    Some(match values {
        Float32x2(values) => each(values, |value| value),
        Float32x3(values) => each(values, |value| value),
        Float32x4(values) => each(values, |value| value),
        Unorm8x4(values) => each(values, |value| f32::from(value) / 255.0),
        Unorm16x4(values) => each(values, |value| f32::from(value) / 65535.0),
        Uint16x4(values) => each(values, f32::from),
        _ => return None,
    })
}

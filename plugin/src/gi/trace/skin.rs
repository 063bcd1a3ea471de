//! Skinned meshes as occluders: what each joint moves is a rigid piece of the mesh.
//!
//! A ray needs a hierarchy in a space where triangles are at rest. Posed triangles have none, and a
//! hierarchy of a character built anew in every frame costs more than the rays through it. So each
//! triangle belongs to the joint that moves it most, and all of a joint's triangles move rigidly.
//! Vertices that several joints share would then stand off the posed surface, which would occlude
//! itself. So they are drawn towards the middle of their piece, by the weight of the other joints:
//! a piece is exact where one joint alone moves the mesh, and slimmer where it bends.

use std::collections::BTreeMap;

use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::mesh::VertexAttributeValues;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;

use crate::gi::surfaces::Triangles;

/// Identifies an instance: a mesh, or the piece of a skinned mesh that one joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct InstanceKey {
    pub entity: Entity,
    /// Index of the joint; 0 for a mesh without a skin.
    pub joint: u16,
}

impl InstanceKey {
    /// A mesh without a skin.
    pub(super) fn whole(entity: Entity) -> Self {
        Self { entity, joint: 0 }
    }
}

/// Where joints put their parts.
#[derive(SystemParam)]
pub(super) struct Skins<'w, 's> {
    bind_poses: Option<Res<'w, Assets<SkinnedMeshInverseBindposes>>>,
    joints: Query<'w, 's, &'static GlobalTransform>,
    moved: Query<'w, 's, (), Changed<GlobalTransform>>,
    skins: Query<'w, 's, (Entity, &'static SkinnedMesh), With<Mesh3d>>,
}

impl Skins<'_, '_> {
    /// Each joint, and what maps the mesh's own space to the world there; `None` while the bind
    /// poses are not loaded. The mesh's own transform does not matter, as when it is rendered.
    pub(super) fn places(
        &self,
        skin: &SkinnedMesh,
    ) -> Option<impl Iterator<Item = (u16, Affine3A)>> {
        let poses = self.bind_poses.as_ref()?.get(&skin.inverse_bindposes)?;
        Some(skin.joints.iter().zip(0u16..).filter_map(|(joint, index)| {
            let world = self.joints.get(*joint).ok()?.affine();
            let pose = poses.get(usize::from(index)).copied().unwrap_or(Mat4::IDENTITY);
            Some((index, world * Affine3A::from_mat4(pose)))
        }))
    }

    /// Parts of skins of which a joint moved since the last frame, and where they are.
    pub(super) fn moved(&self) -> impl Iterator<Item = (InstanceKey, Affine3A)> {
        let is_moved =
            |skin: &SkinnedMesh| skin.joints.iter().any(|joint| self.moved.contains(*joint));
        self.skins.iter().filter(move |(_, skin)| is_moved(skin)).flat_map(|(entity, skin)| {
            let places = self.places(skin).into_iter().flatten();
            places.map(move |(joint, affine)| (InstanceKey { entity, joint }, affine))
        })
    }
}

/// Joints and weights of a mesh's vertices.
pub(super) struct Influences {
    joints: Vec<[u16; 4]>,
    weights: Vec<[f32; 4]>,
}

impl Influences {
    /// `None` without both attributes in the formats that Bevy draws.
    pub(super) fn new(mesh: &Mesh) -> Option<Self> {
        let attribute = |attribute| mesh.try_attribute_option(attribute).ok()?;
        let (VertexAttributeValues::Uint16x4(joints), VertexAttributeValues::Float32x4(weights)) =
            (attribute(Mesh::ATTRIBUTE_JOINT_INDEX)?, attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT)?)
        else {
            return None;
        };
        Some(Self { joints: joints.clone(), weights: weights.clone() })
    }

    /// A joint's share in moving a vertex, 0 to 1.
    fn share(&self, vertex: usize, joint: u16) -> f32 {
        let (mut of_joint, mut of_all) = (0.0, 0.0);
        for (index, weight) in self.of(vertex) {
            of_all += weight;
            if index == joint {
                of_joint += weight;
            }
        }
        if of_all > 0.0 { of_joint / of_all } else { 0.0 }
    }

    /// Joints that move a vertex, and their weights, above 0.
    fn of(&self, vertex: usize) -> impl Iterator<Item = (u16, f32)> {
        let joints = self.joints.get(vertex).into_iter().flatten();
        let weights = self.weights.get(vertex).into_iter().flatten();
        joints
            .zip(weights)
            .map(|(joint, weight)| (*joint, *weight))
            .filter(|(_, weight)| *weight > 0.0 && weight.is_finite())
    }
}

/// Splits triangles by the joint that moves them most, in the order of joints. Triangles that no
/// joint moves are left out.
pub(super) fn split(influences: &Influences, triangles: Triangles) -> Vec<(u16, Triangles)> {
    let mut pieces = BTreeMap::<u16, Triangles>::new();
    for (corners, positions) in triangles.corners.into_iter().zip(triangles.positions) {
        let strength = |joint: u16| -> f32 {
            corners.iter().map(|corner| influences.share(*corner, joint)).sum()
        };
        // The lower index of equals, so that the split does not depend on the order of influences.
        let most = corners
            .iter()
            .flat_map(|corner| influences.of(*corner))
            .map(|(joint, _)| (strength(joint), joint))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, joint)) = most else { continue };
        let piece = pieces
            .entry(joint)
            .or_insert_with(|| Triangles { corners: Vec::new(), positions: Vec::new() });
        piece.corners.push(corners);
        piece.positions.push(positions);
    }
    for (joint, piece) in &mut pieces {
        slim(piece, |vertex| influences.share(vertex, *joint));
    }
    pieces.into_iter().collect()
}

/// Draws vertices towards the middle of their piece by the share of other joints in them.
fn slim(piece: &mut Triangles, share: impl Fn(usize) -> f32) {
    let corners = || piece.corners.iter().flatten();
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for (corner, position) in corners().zip(piece.positions.iter().flatten()) {
        let share = share(*corner);
        (sum, total) = (sum + *position * share, total + share);
    }
    let middle = sum / total;
    for (corner, position) in corners().zip(piece.positions.iter_mut().flatten()) {
        *position = middle.lerp(*position, share(*corner));
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::PrimitiveTopology;

    use super::*;
    use crate::gi::surfaces::triangles;

    /// A strip of triangles, each of corners at (i, 0), (i, 1) and (i + 1, 0), with the same
    /// influences at all three.
    fn strip(influences: &[([u16; 4], [f32; 4])]) -> Mesh {
        let positions: Vec<[f32; 3]> = (0..influences.len())
            .flat_map(|i| [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]].map(|[x, y]| [i as f32 + x, y, 0.0]))
            .collect();
        let each = |count: &([u16; 4], [f32; 4])| [*count; 3];
        let (joints, weights): (Vec<_>, Vec<_>) = influences.iter().flat_map(each).unzip();
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_JOINT_INDEX,
                VertexAttributeValues::Uint16x4(joints),
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights)
    }

    fn pieces(mesh: &Mesh) -> Vec<(u16, Triangles)> {
        split(&Influences::new(mesh).unwrap(), triangles(mesh).unwrap())
    }

    #[test]
    fn triangles_belong_to_the_joint_that_moves_them_most() {
        let mesh = strip(&[
            ([3, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]),
            ([1, 3, 0, 0], [0.4, 0.6, 0.0, 0.0]),
            // The same joint twice, and weights that do not sum to one.
            ([1, 3, 1, 0], [4.0, 5.0, 3.0, 0.0]),
            // The lower of equals.
            ([7, 1, 0, 0], [0.5, 0.5, 0.0, 0.0]),
        ]);
        let found: Vec<_> =
            pieces(&mesh).iter().map(|(joint, piece)| (*joint, piece.corners.len())).collect();
        assert_eq!(found, [(1, 2), (3, 2)]);
    }

    #[test]
    fn a_piece_is_exact_where_one_joint_moves_it_and_slimmer_elsewhere() {
        let exact = &pieces(&strip(&[([2, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])]))[0].1;
        assert_eq!(exact.positions[0], [Vec3::ZERO, Vec3::Y, Vec3::X]);
        let slim = &pieces(&strip(&[([2, 4, 0, 0], [0.75, 0.25, 0.0, 0.0])]))[0].1;
        let middle = (Vec3::X + Vec3::Y) / 3.0;
        for (is, was) in slim.positions[0].iter().zip(exact.positions[0]) {
            assert!((*is - middle).abs_diff_eq(0.75 * (was - middle), 1e-6), "{is}");
        }
    }

    #[test]
    fn influences_that_move_nothing_are_left_out() {
        let nan = f32::NAN;
        let mesh = strip(&[
            ([0; 4], [0.0; 4]),
            ([0; 4], [nan, -1.0, f32::INFINITY, 0.0]),
            ([5, 6, 0, 0], [nan, 1e-30, -2.0, 0.0]),
        ]);
        let pieces = pieces(&mesh);
        assert_eq!(pieces.len(), 1);
        let (joint, piece) = &pieces[0];
        assert_eq!((*joint, piece.positions.len()), (6, 1));
        assert!(piece.positions[0].iter().all(|position| position.is_finite()));
        let bare = strip(&[([0; 4], [1.0, 0.0, 0.0, 0.0])])
            .with_removed_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT);
        assert!(Influences::new(&bare).is_none());
    }
}

//! A creature with bones: a tapered trunk of five rings, which sways.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

/// Bones, one above the other.
const BONES: u16 = 5;
/// Corners of a ring.
const CORNERS: u32 = 12;
/// Distance between bones, metres.
const STEP: f32 = 0.45;

/// A bone by its number from below.
#[derive(Component)]
pub(crate) struct Bone(u16);

pub(crate) fn spawn(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut poses: ResMut<Assets<SkinnedMeshInverseBindposes>>,
) {
    let at = Transform::from_xyz(2.2, 0.0, 1.0);
    let mut joints: Vec<Entity> = Vec::new();
    for number in 0..BONES {
        let place = if number == 0 { at } else { Transform::from_xyz(0.0, STEP, 0.0) };
        let bone = commands.spawn((Bone(number), place, Visibility::default())).id();
        if let Some(below) = joints.last() {
            commands.entity(*below).add_child(bone);
        }
        joints.push(bone);
    }
    let inverse =
        (0..BONES).map(|bone| Mat4::from_translation(Vec3::NEG_Y * STEP * f32::from(bone)));
    let inverse_bindposes =
        poses.add(SkinnedMeshInverseBindposes::from(inverse.collect::<Vec<_>>()));
    commands.spawn((
        Mesh3d(meshes.add(trunk())),
        MeshMaterial3d(materials.add(Color::srgb(0.75, 0.6, 0.15))),
        SkinnedMesh { inverse_bindposes, joints },
        at,
    ));
}

/// Bends each bone a little, one after the other.
pub(crate) fn sway(time: Res<Time>, mut bones: Query<(&Bone, &mut Transform)>) {
    for (bone, mut transform) in &mut bones {
        let phase = time.elapsed_secs() * 1.5 - 0.6 * f32::from(bone.0);
        transform.rotation = Quat::from_rotation_z(0.12 * phase.sin());
    }
}

/// Rings of corners, each of which follows its bone.
fn trunk() -> Mesh {
    let (mut positions, mut normals, mut joints, mut indices) = (vec![], vec![], vec![], vec![]);
    for ring in 0..BONES {
        let radius = 0.4 * (1.0 - 0.2 * f32::from(ring));
        for corner in 0..CORNERS {
            let around = Vec2::from_angle(std::f32::consts::TAU * corner as f32 / CORNERS as f32);
            let out = vec3(around.x, 0.0, around.y);
            positions.push(out * radius + Vec3::Y * STEP * f32::from(ring));
            normals.push(out);
            joints.push([ring, 0, 0, 0]);
            if ring > 0 {
                let above = u32::from(ring) * CORNERS;
                let (next, below) = ((corner + 1) % CORNERS, above - CORNERS);
                indices.extend([below + corner, above + corner, below + next]);
                indices.extend([above + corner, above + next, below + next]);
            }
        }
    }
    let weights = vec![[1.0f32, 0.0, 0.0, 0.0]; positions.len()];
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_INDEX,
            VertexAttributeValues::Uint16x4(joints),
        )
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights)
        .with_inserted_indices(Indices::U32(indices))
}

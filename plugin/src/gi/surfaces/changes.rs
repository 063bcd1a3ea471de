//! What changed of meshes since the last frame, found once for all that is derived from them.

use bevy::asset::AssetEvent;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers, VisibilityRange};
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::mesh::Mesh3d;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

/// What changed of meshes since the last frame.
#[derive(Resource, Default)]
pub(in crate::gi) struct MeshDelta {
    /// Anything but the places of meshes and their assets: what there is, its materials, what is
    /// shown.
    pub altered: bool,
    /// Meshes without a skin that moved, and where they are.
    pub moved: Vec<(Entity, Affine3A)>,
}

type Altered = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Changed<RenderLayers>,
    Added<NotShadowCaster>,
    Changed<SkinnedMesh>,
)>;

#[derive(SystemParam)]
pub(super) struct MeshChanges<'w, 's> {
    altered: Query<'w, 's, (), (With<Mesh3d>, Altered)>,
    moved: Query<
        'w,
        's,
        (Entity, &'static GlobalTransform),
        (With<Mesh3d>, Without<SkinnedMesh>, Changed<GlobalTransform>),
    >,
    // Their level of detail depends on where cameras are.
    ranged: Query<'w, 's, (), (With<Mesh3d>, With<VisibilityRange>)>,
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    without_material: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
    shadowed: RemovedComponents<'w, 's, NotShadowCaster>,
    unskinned: RemovedComponents<'w, 's, SkinnedMesh>,
    on_all_layers: RemovedComponents<'w, 's, RenderLayers>,
    unranged: RemovedComponents<'w, 's, VisibilityRange>,
    materials: Option<MessageReader<'w, 's, AssetEvent<StandardMaterial>>>,
    bind_poses: Option<MessageReader<'w, 's, AssetEvent<SkinnedMeshInverseBindposes>>>,
}

impl MeshChanges<'_, '_> {
    /// Reads everything, so that no change counts twice.
    fn are_altered(&mut self) -> bool {
        let counts = [
            self.meshes.read().count(),
            self.without_material.read().count(),
            self.shadowed.read().count(),
            self.unskinned.read().count(),
            self.on_all_layers.read().count(),
            self.unranged.read().count(),
            self.materials.as_mut().map_or(0, |events| events.read().count()),
            self.bind_poses.as_mut().map_or(0, |events| events.read().count()),
        ];
        counts.iter().any(|count| *count > 0) || !self.ranged.is_empty() || !self.altered.is_empty()
    }
}

/// Notes what changed. In a frame in which it does not run, changes are kept for the next one.
pub(super) fn note(mut delta: ResMut<MeshDelta>, mut changes: MeshChanges) {
    let delta = &mut *delta;
    delta.altered = changes.are_altered();
    delta.moved.clear();
    // Whoever reads an altered scene reads all of it.
    if !delta.altered {
        let moved = changes.moved.iter();
        delta.moved.extend(moved.map(|(entity, transform)| (entity, transform.affine())));
    }
}

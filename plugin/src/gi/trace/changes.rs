//! What changed of the meshes that may occlude light.

use bevy::asset::AssetEvent;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers, VisibilityRange};
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::light::NotShadowCaster;
use bevy::mesh::Mesh3d;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

type Altered = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Changed<RenderLayers>,
    Added<NotShadowCaster>,
    Added<SkinnedMesh>,
)>;

/// Changes of meshes since the last frame.
#[derive(SystemParam)]
pub(super) struct MeshChanges<'w, 's> {
    altered: Query<'w, 's, (), (With<Mesh3d>, Altered)>,
    moved:
        Query<'w, 's, (Entity, &'static GlobalTransform), (With<Mesh3d>, Changed<GlobalTransform>)>,
    // Their level of detail depends on where cameras are.
    ranged: Query<'w, 's, (), (With<Mesh3d>, With<VisibilityRange>)>,
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    without_material: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
    shadowed: RemovedComponents<'w, 's, NotShadowCaster>,
    unskinned: RemovedComponents<'w, 's, SkinnedMesh>,
    on_all_layers: RemovedComponents<'w, 's, RenderLayers>,
    unranged: RemovedComponents<'w, 's, VisibilityRange>,
    materials: Option<MessageReader<'w, 's, AssetEvent<StandardMaterial>>>,
}

impl MeshChanges<'_, '_> {
    /// Whether anything changed but the places of meshes. Reads everything, so that no change
    /// counts twice.
    pub(super) fn are_altered(&mut self) -> bool {
        let gone = [
            self.meshes.read().count(),
            self.without_material.read().count(),
            self.shadowed.read().count(),
            self.unskinned.read().count(),
            self.on_all_layers.read().count(),
            self.unranged.read().count(),
        ];
        let materials = self.materials.as_mut().map_or(0, |events| events.read().count());
        materials > 0
            || gone.iter().any(|count| *count > 0)
            || !self.ranged.is_empty()
            || !self.altered.is_empty()
    }

    /// The meshes that moved.
    pub(super) fn moved(&self) -> impl Iterator<Item = (Entity, &GlobalTransform)> {
        self.moved.iter()
    }
}

//! Surfaces as the main world can read them: triangles, textures and alpha masks of meshes.
//!
//! For surfaces outside every rendered view that occlude light, emit it or reflect it again.

mod copies;
mod cutout;
mod mesh;
mod points;
mod reflectance;
mod scan;
mod set;

use bevy::app::{App, PostUpdate};
use bevy::asset::{Asset, AssetEvent, AssetEventSystems, AssetId};
use bevy::camera::visibility::{
    NoFrustumCulling, RenderLayers, VisibilityRange, VisibilitySystems,
};
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::mesh::morph::{MeshMorphWeights, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::HashSet;
use bevy::transform::TransformSystems;

use super::schedule::SceneSystems;
pub use copies::GiTextureCopies;
pub(super) use copies::finish;
pub(super) use cutout::{Cutout, Mask};
pub(super) use mesh::{MeshTexture, Sides, SurfaceAssets, TextureUse, Triangles, triangles};
pub(super) use points::{
    MAX_COORDINATE, SurfacePoint, SurfacePoints, TrianglePoint, area_matrix, is_in_range,
};
pub(super) use reflectance::{MaterialSample, Reflectance, is_deferred, occludes};
use scan::{ChangeKind, Columns, scan};
pub(super) use set::{
    SurfaceCache, SurfaceChange, SurfaceInstance, SurfaceKey, SurfaceMesh, SurfaceSet,
};

pub(super) fn build(app: &mut App) {
    app.init_resource::<MeshChanges>().add_systems(
        PostUpdate,
        // Need this frame's asset events, final transforms, boxes and visibility.
        note_changes
            .in_set(SceneSystems::Changes)
            .after(AssetEventSystems)
            .after(TransformSystems::Propagate)
            .after(VisibilitySystems::VisibilityPropagate)
            .after(VisibilitySystems::CalculateBounds),
    );
    copies::build(app);
}

/// What changed of meshes and of assets since the last frame.
#[derive(Resource, Default)]
pub(super) struct MeshChanges {
    /// Anything may have changed.
    pub unknown: bool,
    /// Meshes that came, went or changed in anything but their place or the mesh asset itself.
    pub altered: Vec<Entity>,
    /// Meshes without a skin that moved, and where they are.
    pub moved: Vec<(Entity, Affine3A)>,
    /// Meshes of which anything changed that can be seen, and those that lost a component. Changed
    /// assets are not among it.
    pub touched: Vec<Entity>,
    /// Entities that lost `Mesh3d`; also in `altered`.
    pub gone: Vec<Entity>,
    /// Assets that were added, changed or removed.
    pub meshes: HashSet<AssetId<Mesh>>,
    pub images: HashSet<AssetId<Image>>,
    pub materials: HashSet<AssetId<StandardMaterial>>,
}

impl MeshChanges {
    /// Whether nothing changed of meshes.
    pub(crate) fn is_empty(&self) -> bool {
        !self.is_altered() && self.touched.is_empty()
    }

    /// All meshes that changed, sorted, each once.
    pub(crate) fn changed(&self) -> Vec<Entity> {
        let mut all = [&self.altered[..], &self.touched].concat();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Whether anything but places changed.
    pub(crate) fn is_altered(&self) -> bool {
        self.unknown || !self.altered.is_empty()
    }
}

#[derive(SystemParam)]
pub(super) struct MeshReader<'w, 's> {
    columns: Query<'w, 's, Columns, With<Mesh3d>>,
    // Their level of detail depends on where cameras are.
    ranged: Query<'w, 's, Entity, (With<Mesh3d>, With<VisibilityRange>)>,
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    without_material: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
    shadowed: RemovedComponents<'w, 's, NotShadowCaster>,
    unskinned: RemovedComponents<'w, 's, SkinnedMesh>,
    on_all_layers: RemovedComponents<'w, 's, RenderLayers>,
    unranged: RemovedComponents<'w, 's, VisibilityRange>,
    culled: RemovedComponents<'w, 's, NoFrustumCulling>,
    mesh_events: Option<MessageReader<'w, 's, AssetEvent<Mesh>>>,
    image_events: Option<MessageReader<'w, 's, AssetEvent<Image>>>,
    material_events: Option<MessageReader<'w, 's, AssetEvent<StandardMaterial>>>,
    with_material: Query<'w, 's, (Entity, &'static MeshMaterial3d<StandardMaterial>)>,
    bind_poses: Option<MessageReader<'w, 's, AssetEvent<SkinnedMeshInverseBindposes>>>,
    morphed: Query<'w, 's, (Entity, &'static MeshMorphWeights), With<Mesh3d>>,
    weights: Query<'w, 's, (), Changed<MorphWeights>>,
}

impl MeshReader<'_, '_> {
    /// Reads everything, so that no change counts twice.
    fn read(&mut self, changes: &mut MeshChanges) {
        let MeshChanges { unknown, altered, moved, touched, gone, meshes, images, materials } =
            changes;
        for list in [&mut *altered, touched, gone] {
            list.clear();
        }
        moved.clear();
        *unknown = self.bind_poses.as_mut().map_or(0, |events| events.read().count()) > 0;
        let is_scanned = scan(&self.columns, |mesh| {
            touched.push(mesh.entity);
            if mesh.has(ChangeKind::Kind) {
                altered.push(mesh.entity);
            }
            if mesh.has(ChangeKind::Place)
                && !mesh.is_skinned
                && let Some(transform) = mesh.transform
            {
                moved.push((mesh.entity, transform.affine()));
            }
        });
        *unknown |= !is_scanned;
        // Weights that another entity holds for several meshes.
        touched.extend(self.morphed.iter().filter_map(|(mesh, weights)| match weights {
            MeshMorphWeights::Reference(holder) => self.weights.contains(*holder).then_some(mesh),
            MeshMorphWeights::Value { .. } => None,
        }));
        gone.extend(self.meshes.read());
        altered.extend_from_slice(gone);
        let lost = touched.len();
        touched.extend(self.without_material.read());
        touched.extend(self.shadowed.read());
        touched.extend(self.unskinned.read());
        touched.extend(self.on_all_layers.read());
        touched.extend(self.unranged.read());
        touched.extend(self.culled.read());
        altered.extend_from_slice(&touched[lost..]);
        altered.extend(&self.ranged);
        *meshes = changed_assets(&mut self.mesh_events);
        *images = changed_assets(&mut self.image_events);
        *materials = changed_assets(&mut self.material_events);
        if !materials.is_empty() {
            let uses = self.with_material.iter();
            let uses = uses.filter(|(_, material)| materials.contains(&material.id()));
            altered.extend(uses.map(|(entity, _)| entity));
        }
    }
}

/// Assets that were added, changed or removed.
fn changed_assets<A: Asset>(
    events: &mut Option<MessageReader<AssetEvent<A>>>,
) -> HashSet<AssetId<A>> {
    let changed = |event: &AssetEvent<A>| match event {
        AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id } => {
            Some(*id)
        }
        AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. } => None,
    };
    events.iter_mut().flat_map(MessageReader::read).filter_map(changed).collect()
}

/// Notes what changed. In a frame in which it does not run, changes are kept for the next one.
pub(super) fn note_changes(mut changes: ResMut<MeshChanges>, mut reader: MeshReader) {
    reader.read(&mut changes);
}

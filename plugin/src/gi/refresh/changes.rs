//! Where the scene changed since the last frame.

use bevy::asset::{Asset, AssetEvent, AssetId, Assets, VisitAssetDependencies};
use bevy::camera::Camera;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::light::NotShadowCaster;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::HashSet;
use bevy::transform::components::{GlobalTransform, Transform};
use bevy::transform::helper::TransformHelper;

use crate::gi::rsm::Around;

type Touched = Or<(
    Changed<Transform>,
    Changed<GlobalTransform>,
    Changed<Aabb>,
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Changed<MeshMorphWeights>,
    Changed<RenderLayers>,
    Changed<NotShadowCaster>,
)>;

/// What changed since the last frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Changes {
    /// Meshes came, went, moved or changed: where they were and where they are. Empty where
    /// `everywhere`.
    pub spheres: Vec<Around>,
    /// Something changed, and nobody knows where.
    pub everywhere: bool,
    /// An asset of the scene was added, changed or removed.
    pub arrived: bool,
}

impl Changes {
    /// Whether anything visible changed, apart from what arrives.
    pub(super) fn any(&self) -> bool {
        self.everywhere || !self.spheres.is_empty()
    }
}

/// Whether anything in the scene changed since the last frame, and where.
#[derive(SystemParam)]
pub(super) struct SceneChanges<'w, 's> {
    touched: Query<'w, 's, Entity, (With<Mesh3d>, Touched)>,
    // A child's global transform is known only after propagation, which may be later in the frame.
    parents: Query<'w, 's, Entity, (With<Children>, Without<Camera>, Changed<Transform>)>,
    children: Query<'w, 's, &'static Children>,
    skins: Query<'w, 's, &'static SkinnedMesh>,
    moved: Query<'w, 's, (), Or<(Changed<Transform>, Changed<GlobalTransform>)>>,
    bounds: Query<'w, 's, &'static Aabb, With<Mesh3d>>,
    transforms: TransformHelper<'w, 's>,
    gone: RemovedComponents<'w, 's, Mesh3d>,
    unhidden: RemovedComponents<'w, 's, NotShadowCaster>,
    known: Local<'s, EntityHashMap<Around>>,
    assets: AssetChanges<'w, 's>,
}

impl SceneChanges<'_, '_> {
    /// Reads everything, so that no change counts twice.
    pub(super) fn read(&mut self) -> Changes {
        let mut changes = Changes { arrived: self.assets.read(), ..Default::default() };
        // Joints move vertices out of the mesh's box.
        changes.everywhere = self
            .skins
            .iter()
            .flat_map(|skin| &skin.joints)
            .any(|joint| self.moved.contains(*joint));
        for mesh in self.gone.read() {
            match self.known.remove(&mesh) {
                Some(was) => changes.spheres.push(was),
                None => changes.everywhere = true,
            }
        }
        let inherited =
            self.parents.iter().flat_map(|parent| self.children.iter_descendants(parent));
        for mesh in self.touched.iter().chain(inherited).chain(self.unhidden.read()) {
            let Ok(aabb) = self.bounds.get(mesh) else {
                // Not a mesh, or one that Bevy has not measured yet.
                changes.everywhere |= self.touched.contains(mesh);
                continue;
            };
            let Ok(transform) = self.transforms.compute_global_transform(mesh) else {
                changes.everywhere = true;
                continue;
            };
            let is = Around::mesh(aabb, &transform);
            let was = self.known.insert(mesh, is);
            changes.spheres.extend(was.filter(|was| *was != is));
            changes.spheres.push(is);
        }
        if changes.everywhere {
            changes.spheres.clear();
        }
        changes
    }
}

/// Whether assets of the scene changed since the last frame.
#[derive(SystemParam)]
struct AssetChanges<'w, 's> {
    meshes: Option<MessageReader<'w, 's, AssetEvent<Mesh>>>,
    images: Option<MessageReader<'w, 's, AssetEvent<Image>>>,
    materials: Option<MessageReader<'w, 's, AssetEvent<StandardMaterial>>>,
    shown: Query<'w, 's, &'static Mesh3d>,
    all_materials: Option<Res<'w, Assets<StandardMaterial>>>,
}

impl AssetChanges<'_, '_> {
    /// Images of an interface, and meshes that nothing shows, do not count.
    fn read(&mut self) -> bool {
        // Reads all, or the rest would count in the next frame.
        let (meshes, images) = (changed(&mut self.meshes), changed(&mut self.images));
        let materials = changed(&mut self.materials);
        !materials.is_empty()
            || !meshes.is_empty() && self.shown.iter().any(|mesh| meshes.contains(&mesh.id()))
            || !images.is_empty() && self.uses_any(&images)
    }

    /// Whether any material has a texture among `images`.
    fn uses_any(&self, images: &HashSet<AssetId<Image>>) -> bool {
        let Some(materials) = &self.all_materials else { return true };
        let mut found = false;
        for (_, material) in materials.iter() {
            material.visit_dependencies(&mut |id| {
                found |= id.try_typed().is_ok_and(|id| images.contains(&id));
            });
            if found {
                break;
            }
        }
        found
    }
}

fn changed<A: Asset>(events: &mut Option<MessageReader<AssetEvent<A>>>) -> HashSet<AssetId<A>> {
    let id = |event: &AssetEvent<A>| match event {
        AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id } => {
            Some(*id)
        }
        AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. } => None,
    };
    events.iter_mut().flat_map(MessageReader::read).filter_map(id).collect()
}

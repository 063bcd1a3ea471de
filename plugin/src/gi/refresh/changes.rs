//! Where the scene changed since the last frame.

use bevy::asset::{Asset, AssetEvent, AssetId, Assets, VisitAssetDependencies};
use bevy::camera::primitives::Aabb;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::HashSet;
use bevy::transform::components::GlobalTransform;

use crate::gi::rsm::Around;
use crate::gi::surfaces::MeshDelta;

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
    delta: Res<'w, MeshDelta>,
    meshes: Query<'w, 's, (Option<&'static Aabb>, &'static GlobalTransform), With<Mesh3d>>,
    skins: Query<'w, 's, &'static SkinnedMesh>,
    moved: Query<'w, 's, (), Changed<GlobalTransform>>,
    known: Local<'s, EntityHashMap<Around>>,
    assets: AssetChanges<'w, 's>,
}

impl SceneChanges<'_, '_> {
    /// Reads everything, so that no change counts twice.
    pub(super) fn read(&mut self) -> Changes {
        let mut changes = Changes { arrived: self.assets.read(), ..Default::default() };
        // Joints move vertices out of the mesh's box.
        changes.everywhere = self.delta.unknown
            || self
                .skins
                .iter()
                .flat_map(|skin| &skin.joints)
                .any(|joint| self.moved.contains(*joint));
        for mesh in &self.delta.gone {
            match self.known.remove(mesh) {
                Some(was) => changes.spheres.push(was),
                None => changes.everywhere = true,
            }
        }
        for mesh in &self.delta.touched {
            match self.meshes.get(*mesh) {
                Ok((Some(aabb), transform)) => {
                    let is = Around::mesh(aabb, transform);
                    let was = self.known.insert(*mesh, is);
                    changes.spheres.extend(was.filter(|was| *was != is));
                    changes.spheres.push(is);
                }
                // Bevy has not measured it yet.
                Ok((None, _)) => changes.everywhere = true,
                // Gone.
                Err(_) => {}
            }
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

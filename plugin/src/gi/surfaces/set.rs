//! The surfaces of the scene that emit or reflect, each with what is derived from it.

use bevy::asset::AssetId;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::prelude::*;
use bevy::ecs::query::{QueryData, QueryFilter};
use bevy::math::Affine3A;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

use super::cache::{SurfaceCache, SurfaceKey};
use super::changes::MeshChanges;
use crate::gi::view::{MeshVisibility, VisibilityFilter};

/// A mesh of the scene that may be such a surface.
#[derive(QueryData)]
pub(in crate::gi) struct SurfaceMesh {
    entity: Entity,
    mesh: &'static Mesh3d,
    material: &'static MeshMaterial3d<StandardMaterial>,
    place: &'static GlobalTransform,
    visible: &'static InheritedVisibility,
    showing: MeshVisibility,
}

/// A surface in the scene.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::gi) struct SurfaceInstance<Key, Material> {
    pub entity: Entity,
    pub key: Key,
    pub affine: Affine3A,
    /// What its material says beyond its key.
    pub material: Material,
}

/// The visible surfaces of one kind, and a value for each key among them.
pub(in crate::gi) struct SurfaceSet<Key, Material, Value> {
    pub cache: SurfaceCache<Key, Value>,
    /// Sorted by entity, since query order is arbitrary.
    pub instances: Vec<SurfaceInstance<Key, Material>>,
    /// The GI cameras' layers for which instances are those of the scene, if they are: all assets
    /// were loaded, and no mesh was nowhere.
    read_for: Option<RenderLayers>,
}

// The derive would ask for the defaults of keys and values.
impl<Key, Material, Value> Default for SurfaceSet<Key, Material, Value> {
    fn default() -> Self {
        Self { cache: SurfaceCache::default(), instances: Vec::new(), read_for: None }
    }
}

impl<Key, Material, Value> SurfaceSet<Key, Material, Value>
where
    Key: SurfaceKey,
    Material: Clone + PartialEq,
{
    /// Forgets the scene, but no value.
    pub(crate) fn clear(&mut self) {
        self.instances.clear();
        self.read_for = None;
    }

    /// Follows the scene. `kind`: what a mesh and a material are; `None` for what is not of this
    /// kind. `make`: as for [`SurfaceCache::fill`]. Returns whether instances or values changed; it
    /// is up to the caller to reset [`SurfaceCache::changed`].
    pub(crate) fn update<Filter: QueryFilter>(
        &mut self,
        meshes: &Query<SurfaceMesh, Filter>,
        (shown, changes): (&VisibilityFilter, &MeshChanges),
        kind: impl Fn(AssetId<Mesh>, AssetId<StandardMaterial>) -> Option<(Key, Material)>,
        make: impl FnMut(&Key) -> Option<Value>,
    ) -> bool {
        let are_kept = !changes.is_altered()
            && !self.cache.changed
            && self.read_for.as_ref() == Some(shown.layers());
        if are_kept && changes.moved.is_empty() {
            return false;
        }
        let mut is_complete = true;
        let from_scene = || {
            let mut now = Vec::new();
            for SurfaceMeshItem { entity, mesh, material, place, visible, showing } in meshes {
                let affine = place.affine();
                is_complete &= affine.is_finite();
                if affine.is_finite()
                    && visible.get()
                    && shown.has(&showing, place)
                    && let Some((key, material)) = kind(mesh.id(), material.id())
                {
                    now.push(SurfaceInstance { entity, key, affine, material });
                }
            }
            now.sort_unstable_by_key(|instance| instance.entity);
            now
        };
        let moved = if are_kept { self.displaced(changes) } else { None };
        let now = moved.unwrap_or_else(from_scene);
        let used = now.iter().map(|instance| instance.key);
        let is_complete = self.cache.fill(used, make) && is_complete;
        self.read_for = is_complete.then(|| shown.layers().clone());
        let changed = self.cache.changed || self.instances != now;
        self.instances = now;
        changed
    }

    /// Instances after meshes moved; `None` where one is nowhere. Moves of other meshes do not
    /// matter.
    fn displaced(&self, changes: &MeshChanges) -> Option<Vec<SurfaceInstance<Key, Material>>> {
        let mut now = self.instances.clone();
        for (moved, affine) in &changes.moved {
            if let Ok(index) = now.binary_search_by_key(moved, |instance| instance.entity) {
                now[index].affine = *affine;
            }
        }
        now.iter().all(|instance| instance.affine.is_finite()).then_some(now)
    }
}

//! The surfaces of the scene that emit or reflect, each with what is derived from it, kept for as
//! long as the assets behind it stay as they are.

use std::hash::Hash;

use bevy::asset::AssetId;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::prelude::*;
use bevy::ecs::query::{QueryData, QueryFilter};
use bevy::image::Image;
use bevy::math::Affine3A;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::transform::components::GlobalTransform;

use super::MeshChanges;
use crate::gi::view::{MeshVisibility, VisibilityFilter};

/// A surface: a mesh, and what its material says.
pub(in crate::gi) trait SurfaceKey: Copy + Eq + Hash {
    /// The mesh.
    fn mesh(&self) -> AssetId<Mesh>;

    /// Whether it has any of these images.
    fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool;
}

/// A value for each surface in use.
pub(in crate::gi) struct SurfaceCache<Key, Value> {
    pub values: HashMap<Key, Value>,
    /// Set when a value is added or dropped; its user resets it, and sets it for other changes.
    pub changed: bool,
}

// The derive would ask for the defaults of keys and values.
impl<Key, Value> Default for SurfaceCache<Key, Value> {
    fn default() -> Self {
        Self { values: HashMap::default(), changed: false }
    }
}

impl<Key: SurfaceKey, Value> SurfaceCache<Key, Value> {
    /// Drops the values of surfaces whose mesh or images changed or are gone.
    pub(crate) fn read(&mut self, MeshChanges { meshes, images, .. }: &MeshChanges) {
        if !meshes.is_empty() || !images.is_empty() {
            self.keep(|key| !meshes.contains(&key.mesh()) && !key.reads(images));
        }
    }

    /// Drops values of surfaces that are not `used`, and makes those that are missing. `make` gives
    /// `None` while assets are not loaded; it is then asked again in the next frame. Returns whether
    /// all have a value.
    pub(crate) fn fill(
        &mut self,
        used: impl IntoIterator<Item = Key>,
        mut make: impl FnMut(&Key) -> Option<Value>,
    ) -> bool {
        let used: HashSet<Key> = used.into_iter().collect();
        self.keep(|key| used.contains(key));
        let mut have_values = true;
        for key in used {
            if self.values.contains_key(&key) {
                continue;
            }
            match make(&key) {
                Some(value) => {
                    self.values.insert(key, value);
                    self.changed = true;
                }
                None => have_values = false,
            }
        }
        have_values
    }

    fn keep(&mut self, is_kept: impl Fn(&Key) -> bool) {
        let before = self.values.len();
        self.values.retain(|key, _| is_kept(key));
        self.changed |= self.values.len() != before;
    }
}

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

/// What has become of a [`SurfaceSet`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::gi) enum SurfaceChange {
    Nothing,
    /// These instances are elsewhere.
    Moved(Vec<usize>),
    Anything,
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
    /// kind. `make`: as for [`SurfaceCache::fill`]. Returns how instances or values changed; it
    /// is up to the caller to reset [`SurfaceCache::changed`].
    pub(crate) fn update<Filter: QueryFilter>(
        &mut self,
        meshes: &Query<SurfaceMesh, Filter>,
        (shown, changes): (&VisibilityFilter, &MeshChanges),
        kind: impl Fn(AssetId<Mesh>, AssetId<StandardMaterial>) -> Option<(Key, Material)>,
        make: impl FnMut(&Key) -> Option<Value>,
    ) -> SurfaceChange {
        let are_kept = !changes.is_altered()
            && !self.cache.changed
            && self.read_for.as_ref() == Some(shown.layers());
        if are_kept && changes.moved.iter().all(|(_, affine)| affine.is_finite()) {
            return self.displace(changes);
        }
        let mut is_complete = true;
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
        let used = now.iter().map(|instance| instance.key);
        let is_complete = self.cache.fill(used, make) && is_complete;
        self.read_for = is_complete.then(|| shown.layers().clone());
        let changed = self.cache.changed || self.instances != now;
        self.instances = now;
        if changed { SurfaceChange::Anything } else { SurfaceChange::Nothing }
    }

    /// Moves instances. Moves of other meshes do not matter.
    fn displace(&mut self, changes: &MeshChanges) -> SurfaceChange {
        let mut moved = Vec::new();
        for (entity, affine) in &changes.moved {
            let found = self.instances.binary_search_by_key(entity, |instance| instance.entity);
            if let Ok(index) = found
                && self.instances[index].affine != *affine
            {
                self.instances[index].affine = *affine;
                moved.push(index);
            }
        }
        if moved.is_empty() { SurfaceChange::Nothing } else { SurfaceChange::Moved(moved) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, PartialEq, Eq, Hash)]
    struct Key(u128);

    impl SurfaceKey for Key {
        fn mesh(&self) -> AssetId<Mesh> {
            AssetId::Uuid { uuid: bevy::asset::uuid::Uuid::from_u128(self.0) }
        }

        fn reads(&self, _: &HashSet<AssetId<Image>>) -> bool {
            false
        }
    }

    #[test]
    fn values_are_made_once_and_dropped_when_unused() {
        let mut cache = SurfaceCache::<Key, u32>::default();
        let mut made = 0;
        let mut fill = |cache: &mut SurfaceCache<Key, u32>, used: &[Key]| {
            cache.changed = false;
            // The third one's assets are not loaded.
            let have_values = cache.fill(used.iter().copied(), |key| {
                (key.0 != 3).then(|| {
                    made += 1;
                    made
                })
            });
            assert_eq!(have_values, !used.contains(&Key(3)));
            (cache.values.len(), cache.changed)
        };
        assert_eq!(fill(&mut cache, &[Key(1), Key(1), Key(2), Key(3)]), (2, true));
        assert_eq!(fill(&mut cache, &[Key(1), Key(2), Key(3)]), (2, false), "nothing is new");
        assert_eq!(fill(&mut cache, &[Key(2)]), (1, true), "one is gone");
        assert_eq!(fill(&mut cache, &[]), (0, true));
        assert_eq!(made, 2);
    }
}

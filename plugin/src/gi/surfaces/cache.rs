//! What is derived from surfaces, kept for as long as the assets behind it stay as they are.

use std::hash::Hash;

use bevy::asset::{AssetEvent, AssetId};
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::Mesh;
use bevy::platform::collections::{HashMap, HashSet};

/// A surface: a mesh, and what its material says.
pub(in crate::gi) trait SurfaceKey: Copy + Eq + Hash {
    /// The mesh.
    fn mesh(&self) -> AssetId<Mesh>;

    /// Whether it changes when this image does.
    fn reads(&self, image: AssetId<Image>) -> bool;
}

/// This frame's events of meshes and images.
#[derive(SystemParam)]
pub(in crate::gi) struct SurfaceEvents<'w, 's> {
    meshes: Option<MessageReader<'w, 's, AssetEvent<Mesh>>>,
    images: Option<MessageReader<'w, 's, AssetEvent<Image>>>,
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
    pub(crate) fn read(&mut self, events: &mut SurfaceEvents) {
        for event in events.meshes.iter_mut().flat_map(MessageReader::read) {
            let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else {
                continue;
            };
            self.keep(|key| key.mesh() != *id);
        }
        for event in events.images.iter_mut().flat_map(MessageReader::read) {
            let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else {
                continue;
            };
            self.keep(|key| !key.reads(*id));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, PartialEq, Eq, Hash)]
    struct Key(u128);

    impl SurfaceKey for Key {
        fn mesh(&self) -> AssetId<Mesh> {
            AssetId::Uuid { uuid: bevy::asset::uuid::Uuid::from_u128(self.0) }
        }

        fn reads(&self, _: AssetId<Image>) -> bool {
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

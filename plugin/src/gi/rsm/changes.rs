//! Where the scene changed since the last frame.

use bevy::asset::{AssetId, Assets, VisitAssetDependencies};
use bevy::camera::primitives::{Aabb, Sphere};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::math::Vec3;
use bevy::mesh::Mesh3d;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::HashSet;
use bevy::transform::components::GlobalTransform;

use super::extent::sphere_around;
use crate::cut::CUT_DISTANCE;
use crate::gi::surfaces::{GiTextureCopies, MeshChanges};

/// What changed since the last frame.
#[derive(Clone, Debug, Default)]
pub(super) struct SceneChanges {
    /// Meshes came, went, moved or changed: where they were and where they are. Empty where
    /// `everywhere`.
    pub spheres: Vec<Sphere>,
    /// Something changed, and nobody knows where.
    pub everywhere: bool,
    /// An asset of the scene was added, changed or removed.
    pub arrived: bool,
    /// Meshes that moved farther than most motion, and by how much, metres; `None`: those that came.
    pub jumps: EntityHashMap<Option<Vec3>>,
}

impl SceneChanges {
    /// Whether anything visible changed, apart from what arrives.
    pub(super) fn any(&self) -> bool {
        self.everywhere || !self.spheres.is_empty()
    }
}

/// Where a mesh was in the last frame.
#[derive(Clone, Copy)]
struct Known {
    /// `None`: Bevy has not measured it, or never does.
    around: Option<Sphere>,
    origin: Vec3,
}

/// Whether anything in the scene changed since the last frame, and where.
#[derive(SystemParam)]
pub(super) struct SceneReader<'w, 's> {
    mesh_changes: Res<'w, MeshChanges>,
    meshes: Query<'w, 's, (Option<&'static Aabb>, &'static GlobalTransform), With<Mesh3d>>,
    skins: Query<'w, 's, &'static SkinnedMesh>,
    moved: Query<'w, 's, (), Changed<GlobalTransform>>,
    known: Local<'s, EntityHashMap<Known>>,
    shown: Query<'w, 's, &'static Mesh3d>,
    materials: Option<Res<'w, Assets<StandardMaterial>>>,
    copies: Res<'w, GiTextureCopies>,
}

impl SceneReader<'_, '_> {
    /// Reads everything, so that no change counts twice.
    pub(super) fn read(&mut self) -> SceneChanges {
        let mut changes = SceneChanges { arrived: self.has_arrived(), ..Default::default() };
        // Joints move vertices out of the mesh's box.
        changes.everywhere = self.mesh_changes.unknown
            || self
                .skins
                .iter()
                .flat_map(|skin| &skin.joints)
                .any(|joint| self.moved.contains(*joint));
        for mesh in &self.mesh_changes.gone {
            match self.known.remove(mesh).and_then(|was| was.around) {
                Some(was) => changes.spheres.push(was),
                None => changes.everywhere = true,
            }
        }
        for mesh in &self.mesh_changes.touched {
            // Gone.
            let Ok((aabb, transform)) = self.meshes.get(*mesh) else { continue };
            let around = aabb.map(|aabb| sphere_around(aabb, transform));
            let origin = transform.translation();
            let was = self.known.insert(*mesh, Known { around, origin });
            let jump = was.map(|was| origin - was.origin);
            // NaN is none.
            if jump.is_none_or(|jump| jump.length_squared() > CUT_DISTANCE * CUT_DISTANCE) {
                changes.jumps.insert(*mesh, jump);
            }
            match around {
                Some(is) => {
                    changes.spheres.extend(was.and_then(|was| was.around));
                    changes.spheres.push(is);
                }
                None => changes.everywhere = true,
            }
        }
        if changes.everywhere {
            changes.spheres.clear();
        }
        changes
    }

    /// Whether assets of the scene changed, or copies of its textures are on their way: surfaces wait
    /// for them. Images of an interface, and meshes that nothing shows, do not count.
    fn has_arrived(&self) -> bool {
        let MeshChanges { meshes, images, materials, .. } = &*self.mesh_changes;
        !materials.is_empty()
            || self.copies.waiting() > 0
            || !meshes.is_empty() && self.shown.iter().any(|mesh| meshes.contains(&mesh.id()))
            || !images.is_empty() && self.uses_any(images)
    }

    /// Whether any material has a texture among `images`.
    fn uses_any(&self, images: &HashSet<AssetId<Image>>) -> bool {
        let Some(materials) = &self.materials else { return true };
        materials.iter().any(|(_, material)| {
            let mut found = false;
            material.visit_dependencies(&mut |id| {
                found |= id.try_typed().is_ok_and(|id| images.contains(&id));
            });
            found
        })
    }
}

/// By how much the world around a camera was shifted, metres: what moved along with the camera is
/// most of what it shows. `by`: how far the camera moved. `seen`: how far each mesh in its view moved.
///
/// A median: what moves besides, and the rounding of large coordinates, are no part of it.
pub(super) fn shift(by: Vec3, seen: impl Iterator<Item = Vec3>) -> Option<Vec3> {
    if by.length_squared() <= CUT_DISTANCE * CUT_DISTANCE {
        return None;
    }
    let mut count = 0;
    let mut along: Vec<Vec3> = seen
        .inspect(|_| count += 1)
        .filter(|jump| jump.distance_squared(by) <= CUT_DISTANCE * CUT_DISTANCE)
        .collect();
    if along.is_empty() || 4 * along.len() < 3 * count {
        return None;
    }
    let middle = along.len() / 2;
    let mut median = |axis: usize| {
        let (_, found, _) =
            along.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        found[axis]
    };
    Some(Vec3::new(median(0), median(1), median(2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_is_what_most_of_the_view_and_the_camera_share() {
        let by = Vec3::new(4096.0, 0.0, -2048.0);
        let walked = by + Vec3::new(0.1, 0.0, 0.05);
        let seen = |still: usize, along: usize, odd: usize| {
            let jumps = [(still, Vec3::ZERO), (along, by), (odd, by + Vec3::X * 0.3)];
            jumps.into_iter().flat_map(|(count, jump)| std::iter::repeat_n(jump, count))
        };
        assert_eq!(shift(walked, seen(0, 5, 2)), Some(by), "what walks moves besides");
        assert_eq!(shift(walked, seen(2, 6, 0)), Some(by), "what belongs to nobody stays");
        assert_eq!(shift(walked, seen(3, 6, 0)), None);
        assert_eq!(shift(walked, seen(0, 0, 0)), None, "nothing is in view");
        assert_eq!(shift(walked, seen(9, 0, 0)), None, "the camera teleports");
        assert_eq!(shift(Vec3::ZERO, seen(0, 9, 0)), None, "the scene is exchanged");
        assert_eq!(shift(Vec3::NAN, seen(0, 9, 0)), None);
        let rounded = (0..9).map(|index| by + Vec3::Y * (index as f32 - 4.0) * 1e-3);
        assert_eq!(shift(by, rounded), Some(by));
    }
}

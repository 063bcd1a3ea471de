//! The bounding box of the scene.

use bevy::camera::primitives::Aabb;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::math::{Vec3, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;

use super::extent::world_box;
use crate::gi::surfaces::MeshDelta;

/// Bounding box of all meshes that cast shadows.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SceneBox(pub Option<(Vec3, Vec3)>);

/// The box, and the mesh that each of its faces touches.
pub(super) struct Extremes {
    least: Vec3A,
    most: Vec3A,
    /// At the lower faces, then at the upper ones.
    holders: [Entity; 6],
}

impl Default for Extremes {
    fn default() -> Self {
        Self {
            least: Vec3A::INFINITY,
            most: Vec3A::NEG_INFINITY,
            holders: [Entity::PLACEHOLDER; 6],
        }
    }
}

impl Extremes {
    fn grow(&mut self, mesh: Entity, aabb: &Aabb, transform: &GlobalTransform) {
        let (center, half) = world_box(aabb, transform);
        let (low, high) = (center - half, center + half);
        if !low.is_finite() || !high.is_finite() {
            return;
        }
        for axis in 0..3 {
            if low[axis] < self.least[axis] {
                self.holders[axis] = mesh;
            }
            if high[axis] > self.most[axis] {
                self.holders[axis + 3] = mesh;
            }
        }
        (self.least, self.most) = (self.least.min(low), self.most.max(high));
    }
}

/// Grows the box by meshes that came or moved in the last frame, and finds it anew where one that it
/// touches moved or went. A sky dome that casts no shadow is in no map, and must not stretch them.
pub(super) fn update_scene_box(
    mut scene: ResMut<SceneBox>,
    mut extremes: Local<Extremes>,
    meshes: Query<(Entity, &Aabb, &GlobalTransform), (With<Mesh3d>, Without<NotShadowCaster>)>,
    delta: Res<MeshDelta>,
) {
    let changed = || delta.touched.iter().chain(&delta.gone);
    if changed().next().is_none() {
        return;
    }
    if changed().any(|mesh| extremes.holders.contains(mesh)) {
        *extremes = Extremes::default();
        for (mesh, aabb, transform) in &meshes {
            extremes.grow(mesh, aabb, transform);
        }
    } else {
        for mesh in changed() {
            if let Ok((mesh, aabb, transform)) = meshes.get(*mesh) {
                extremes.grow(mesh, aabb, transform);
            }
        }
    }
    let Extremes { least, most, .. } = *extremes;
    let found = least.cmple(most).all().then(|| (Vec3::from(least), Vec3::from(most)));
    scene.set_if_neq(SceneBox(found));
}

#[cfg(test)]
mod tests {
    use bevy::app::{App, Update};
    use bevy::asset::{Assets, Handle};
    use bevy::mesh::Mesh;
    use proptest::prelude::*;

    use super::*;
    use crate::gi::surfaces::note_changes;

    /// A change of one of eight meshes: to a place, to nowhere, into the shade, into the light, or
    /// away.
    #[derive(Clone, Debug)]
    enum Change {
        Move([i8; 3]),
        Lose,
        Shade,
        Light,
        Remove,
    }

    fn change() -> impl Strategy<Value = Change> {
        prop_oneof![
            4 => prop::array::uniform3(-9i8..9).prop_map(Change::Move),
            1 => Just(Change::Lose),
            1 => Just(Change::Shade),
            1 => Just(Change::Light),
            1 => Just(Change::Remove),
        ]
    }

    fn apply(app: &mut App, meshes: &mut [Option<Entity>], index: usize, change: &Change) {
        let world = app.world_mut();
        match (change, meshes[index]) {
            (Change::Move(place), held) => {
                let place = GlobalTransform::from_translation(Vec3::from(place.map(f32::from)));
                let half = Vec3::splat(0.5);
                let mesh = held.unwrap_or_else(|| {
                    let mesh = Mesh3d(Handle::<Mesh>::default());
                    world.spawn((mesh, Aabb::from_min_max(-half, half))).id()
                });
                world.entity_mut(mesh).insert(place);
                meshes[index] = Some(mesh);
            }
            (_, None) => {}
            (Change::Lose, Some(mesh)) => {
                let nowhere = GlobalTransform::from_translation(Vec3::NAN);
                world.entity_mut(mesh).insert(nowhere);
            }
            (Change::Shade, Some(mesh)) => {
                world.entity_mut(mesh).insert(NotShadowCaster);
            }
            (Change::Light, Some(mesh)) => {
                world.entity_mut(mesh).remove::<NotShadowCaster>();
            }
            (Change::Remove, Some(mesh)) => {
                world.despawn(mesh);
                meshes[index] = None;
            }
        }
    }

    /// The box of all meshes, found anew.
    fn expected(app: &mut App) -> Option<(Vec3, Vec3)> {
        let world = app.world_mut();
        let mut all =
            world.query_filtered::<&GlobalTransform, (With<Mesh3d>, Without<NotShadowCaster>)>();
        let places = all.iter(world).map(GlobalTransform::translation).filter(|p| p.is_finite());
        places
            .map(|place| (place - Vec3::splat(0.5), place + Vec3::splat(0.5)))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    proptest! {
        #[test]
        fn the_box_is_that_of_all_meshes_whatever_changed(
            frames in prop::collection::vec(prop::collection::vec((0usize..8, change()), 0..4), 1..20),
        ) {
            let mut app = App::new();
            app.init_resource::<SceneBox>().init_resource::<Assets<Mesh>>();
            app.init_resource::<MeshDelta>();
            app.add_systems(Update, (note_changes, update_scene_box).chain());
            let mut meshes = [None; 8];
            for changes in frames {
                for (index, change) in &changes {
                    apply(&mut app, &mut meshes, *index, change);
                }
                app.update();
                let expected = expected(&mut app);
                prop_assert_eq!(app.world().resource::<SceneBox>().0, expected);
            }
        }
    }
}

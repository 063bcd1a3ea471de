//! The bounding box of the scene.

use bevy::camera::primitives::Aabb;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::math::{Vec3, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;

use super::extent::world_box;
use crate::gi::surfaces::MeshChanges;

/// Bounding box of all meshes that cast shadows.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SceneBox(pub Option<(Vec3, Vec3)>);

/// Lower and upper corner of a box.
type Corners = (Vec3A, Vec3A);

/// Whether any mesh changed or went in this frame.
pub(super) fn is_touched(changes: Res<MeshChanges>) -> bool {
    !changes.touched.is_empty() || !changes.gone.is_empty()
}

/// Fits the box to meshes that came, moved or went in this frame. A sky dome that casts no shadow
/// is in no map, and must not stretch them.
pub(super) fn update_scene_box(
    mut scene: ResMut<SceneBox>,
    mut boxes: Local<EntityHashMap<Corners>>,
    meshes: Query<(&Aabb, &GlobalTransform), (With<Mesh3d>, Without<NotShadowCaster>)>,
    changes: Res<MeshChanges>,
) {
    for mesh in changes.touched.iter().chain(&changes.gone) {
        let place = meshes.get(*mesh).ok().and_then(|(aabb, transform)| {
            let (center, half) = world_box(aabb, transform);
            let (low, high) = (center - half, center + half);
            (low.is_finite() && high.is_finite()).then_some((low, high))
        });
        match place {
            Some(place) => boxes.insert(*mesh, place),
            None => boxes.remove(mesh),
        };
    }
    let around = boxes.values().copied().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    scene.set_if_neq(SceneBox(around.map(|(low, high)| (low.into(), high.into()))));
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
            app.init_resource::<MeshChanges>();
            app.add_systems(Update, (note_changes, update_scene_box.run_if(is_touched)).chain());
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

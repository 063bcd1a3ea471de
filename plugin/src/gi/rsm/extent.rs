//! Where meshes are, to tell which maps a change of the scene concerns; and the bounding box of the
//! scene.

use bevy::camera::primitives::{Aabb, Sphere};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::math::{Vec3, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;

use crate::gi::surfaces::MeshChanges;

/// Centre of a mesh's box in world space, and half its sides along the world's axes.
fn world_box(aabb: &Aabb, transform: &GlobalTransform) -> (Vec3A, Vec3A) {
    let affine = transform.affine();
    (affine.transform_point3a(aabb.center), affine.matrix3.abs() * aabb.half_extents)
}

/// The sphere around a mesh's box, in world space.
pub(super) fn sphere_around(aabb: &Aabb, transform: &GlobalTransform) -> Sphere {
    let (center, half) = world_box(aabb, transform);
    Sphere { center, radius: half.length() }
}

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
    use bevy::camera::{OrthographicProjection, PerspectiveProjection, Projection, ScalingMode};
    use bevy::mesh::Mesh;
    use bevy::transform::components::Transform;
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

    fn at(x: f32, y: f32, z: f32) -> Sphere {
        Sphere { center: Vec3A::new(x, y, z), radius: 1.0 }
    }

    fn meets(place: Transform, lens: impl Into<Projection>, around: &Sphere) -> bool {
        let mut lens = lens.into();
        lens.update(64.0, 64.0);
        lens.compute_frustum(&place.into()).intersects_sphere(around, true)
    }

    #[test]
    fn a_face_of_a_point_light_meets_what_is_before_it() {
        let lens = PerspectiveProjection {
            fov: std::f32::consts::FRAC_PI_2,
            near: 0.02,
            far: 10.0,
            ..Default::default()
        };
        let place = Transform::from_xyz(5.0, 0.0, 0.0);
        for (around, expected) in [
            (at(5.0, 0.0, -10.9), true),
            (at(5.0, 0.0, -11.1), false),
            (at(5.0, 0.0, 0.9), true),
            (at(5.0, 0.0, 1.1), false),
            (at(10.0, 0.0, -4.0), true),
            (at(10.0, 0.0, -3.0), false),
        ] {
            assert_eq!(meets(place, lens.clone(), &around), expected, "{around:?}");
        }
        let endless = PerspectiveProjection { far: f32::INFINITY, ..lens };
        assert!(meets(place, endless, &at(5.0, 0.0, -1e9)));
    }

    #[test]
    fn parallel_light_meets_what_is_in_its_box() {
        let lens = OrthographicProjection {
            near: 0.0,
            far: 20.0,
            scaling_mode: ScalingMode::Fixed { width: 8.0, height: 6.0 },
            ..OrthographicProjection::default_3d()
        };
        let down = Transform::from_xyz(0.0, 10.0, 0.0).looking_to(Vec3::NEG_Y, Vec3::NEG_Z);
        for (around, expected) in [
            (at(0.0, 0.0, 0.0), true),
            (at(4.9, 0.0, 0.0), true),
            (at(5.1, 0.0, 0.0), false),
            (at(0.0, 0.0, 3.9), true),
            (at(0.0, 0.0, 4.1), false),
            (at(0.0, 10.9, 0.0), true),
            (at(0.0, -10.9, 0.0), true),
            (at(0.0, -11.1, 0.0), false),
        ] {
            assert_eq!(meets(down, lens.clone(), &around), expected, "{around:?}");
        }
    }

    #[test]
    fn what_is_not_finite_may_be_anywhere() {
        let lens = PerspectiveProjection { far: 10.0, ..Default::default() };
        for around in [
            at(f32::NAN, 0.0, 0.0),
            Sphere { center: Vec3A::splat(1e9), radius: f32::INFINITY },
            Sphere { center: Vec3A::splat(1e9), radius: f32::NAN },
        ] {
            assert!(meets(Transform::IDENTITY, lens.clone(), &around), "{around:?}");
        }
    }
}

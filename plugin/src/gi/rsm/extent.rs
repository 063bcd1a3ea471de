//! What a map can show, to tell which changes of the scene it must be rendered again for; and the
//! bounding box of the scene.

use bevy::camera::primitives::Aabb;
use bevy::camera::{Projection, ScalingMode};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::math::{Affine3A, Vec3, Vec3A};
use bevy::mesh::Mesh3d;
use bevy::transform::components::{GlobalTransform, Transform};

use crate::gi::surfaces::MeshChanges;

/// Centre in world space and radius of a sphere around a mesh, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BoundingSphere {
    pub center: Vec3A,
    pub radius: f32,
}

/// Centre of a mesh's box in world space, and half its sides along the world's axes.
pub(super) fn world_box(aabb: &Aabb, transform: &GlobalTransform) -> (Vec3A, Vec3A) {
    let affine = transform.affine();
    (affine.transform_point3a(aabb.center), affine.matrix3.abs() * aabb.half_extents)
}

impl BoundingSphere {
    /// The sphere around a mesh's box.
    pub(super) fn mesh(aabb: &Aabb, transform: &GlobalTransform) -> Self {
        let (center, half) = world_box(aabb, transform);
        Self { center, radius: half.length() }
    }
}

/// The part of the world that a map's camera can show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum MapExtent {
    /// All of it.
    Everything,
    /// Of a light with a position: as far as it reaches.
    Near(BoundingSphere),
    /// Oriented box of a directional light: transform and half extents.
    Inside { map_from_world: Affine3A, half: Vec3A },
}

impl MapExtent {
    /// That of a camera, whose transform is global.
    pub(super) fn new(transform: &Transform, projection: &Projection) -> Self {
        let found = match projection {
            Projection::Perspective(lens) => Self::Near(BoundingSphere {
                center: transform.translation.into(),
                // To the corners of the far plane.
                radius: lens.far * (1.0 + 2.0 * (0.5 * lens.fov).tan().powi(2)).sqrt(),
            }),
            Projection::Orthographic(lens) => match lens.scaling_mode {
                ScalingMode::Fixed { width, height } => Self::Inside {
                    map_from_world: transform.compute_affine().inverse(),
                    half: 0.5 * Vec3A::new(width, height, lens.far),
                },
                _ => Self::Everything,
            },
            Projection::Custom(_) => Self::Everything,
        };
        if found.is_finite() { found } else { Self::Everything }
    }

    fn is_finite(&self) -> bool {
        match self {
            Self::Everything => true,
            Self::Near(around) => around.center.is_finite() && around.radius.is_finite(),
            Self::Inside { map_from_world, half } => map_from_world.is_finite() && half.is_finite(),
        }
    }

    /// Whether something there may be in the map. True where either is not finite.
    pub(super) fn meets(&self, other: &BoundingSphere) -> bool {
        let is_outside = match self {
            Self::Everything => false,
            Self::Near(own) => {
                let reach = own.radius + other.radius;
                own.center.distance_squared(other.center) > reach * reach
            }
            Self::Inside { map_from_world, half } => {
                // The camera looks along −Z from its near plane.
                let at = map_from_world.transform_point3a(other.center) + Vec3A::Z * half.z;
                (at.abs() - *half).max_element() > other.radius
            }
        };
        !is_outside
    }
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
    use bevy::camera::{OrthographicProjection, PerspectiveProjection};
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

    fn at(x: f32, y: f32, z: f32) -> BoundingSphere {
        BoundingSphere { center: Vec3A::new(x, y, z), radius: 1.0 }
    }

    #[test]
    fn a_point_light_reaches_as_far_as_its_range() {
        let lens = PerspectiveProjection {
            fov: std::f32::consts::FRAC_PI_2,
            far: 10.0,
            ..Default::default()
        };
        let extent = MapExtent::new(&Transform::from_xyz(5.0, 0.0, 0.0), &lens.clone().into());
        // To the corner of a cube's face at 10 m, and the other's radius.
        assert!(
            extent.meets(&at(5.0 + 18.2, 0.0, 0.0)) && !extent.meets(&at(5.0 + 18.5, 0.0, 0.0))
        );
        let endless = PerspectiveProjection { far: f32::INFINITY, ..lens };
        assert_eq!(MapExtent::new(&Transform::IDENTITY, &endless.into()), MapExtent::Everything);
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
        let extent = MapExtent::new(&down, &lens.into());
        for (around, expected) in [
            (at(0.0, 0.0, 0.0), true),
            (at(4.9, 0.0, 0.0), true),
            (at(5.1, 0.0, 0.0), false),
            (at(0.0, 0.0, 3.9), true),
            (at(0.0, 0.0, 4.1), false),
            (at(0.0, 10.9, 0.0), true),
            (at(0.0, 11.1, 0.0), false),
            (at(0.0, -10.9, 0.0), true),
            (at(0.0, -11.1, 0.0), false),
        ] {
            assert_eq!(extent.meets(&around), expected, "{around:?}");
        }
    }

    #[test]
    fn what_is_not_finite_may_be_anywhere() {
        let lens = PerspectiveProjection { far: 10.0, ..Default::default() };
        let extent = MapExtent::new(&Transform::IDENTITY, &lens.into());
        assert!(extent.meets(&at(f32::NAN, 0.0, 0.0)));
        assert!(extent.meets(&BoundingSphere { center: Vec3A::splat(1e9), radius: f32::INFINITY }));
        assert!(extent.meets(&BoundingSphere { center: Vec3A::splat(1e9), radius: f32::NAN }));
    }
}

//! Lists of maps against those that Bevy makes for a camera in the same place, and what is visible.

use std::any::TypeId;

use bevy::app::{App, Update};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{
    InheritedVisibility, NoFrustumCulling, RenderLayers, ViewVisibility, VisibilityClass,
    VisibleEntities, check_visibility_cpu_culling, update_frusta,
};
use bevy::camera::{Camera, OrthographicProjection, Projection, ScalingMode};
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::math::Vec3;
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;
use proptest::prelude::*;

use super::{MapMeshes, PADDING, is_needed, list};
use crate::gi::rsm::RsmView;
use crate::gi::rsm::map::MapPlace;
use crate::gi::surfaces::{MeshChanges, note_changes};
use crate::gi::view::GiFrame;

/// A change of one of the meshes.
#[derive(Clone, Debug)]
enum Change {
    Move([i8; 3]),
    Grow(u8),
    Hide(bool),
    Layer(usize),
    Shade(bool),
    Uncull(bool),
    Remove,
}

/// A frame: changes of meshes, the map's place and layer, and whether it is drawn.
#[derive(Clone, Debug)]
struct Frame {
    changes: Vec<(usize, Change)>,
    /// Tenths of metres.
    moves: Option<[i8; 3]>,
    layer: Option<usize>,
    is_drawn: bool,
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        4 => prop::array::uniform3(-9i8..9).prop_map(Change::Move),
        1 => (1u8..8).prop_map(Change::Grow),
        1 => any::<bool>().prop_map(Change::Hide),
        1 => (0usize..2).prop_map(Change::Layer),
        1 => any::<bool>().prop_map(Change::Shade),
        1 => any::<bool>().prop_map(Change::Uncull),
        1 => Just(Change::Remove),
    ]
}

fn frame() -> impl Strategy<Value = Frame> {
    (
        prop::collection::vec((0usize..12, change()), 0..6),
        prop::option::weighted(
            0.3,
            prop_oneof![prop::array::uniform3(-40i8..40), prop::array::uniform3(-3i8..3)],
        ),
        prop::option::weighted(0.1, 0usize..2),
        any::<bool>(),
    )
        .prop_map(|(changes, moves, layer, is_drawn)| Frame {
            changes,
            moves,
            layer,
            is_drawn,
        })
}

fn mesh(world: &mut World) -> Entity {
    let mut class = VisibilityClass::default();
    class.push(TypeId::of::<Mesh3d>());
    let half = Vec3::splat(0.5);
    world
        .spawn((
            Mesh3d::default(),
            Aabb::from_min_max(-half, half),
            (InheritedVisibility::VISIBLE, ViewVisibility::default(), class),
        ))
        .id()
}

fn apply(world: &mut World, slot: &mut Option<Entity>, change: &Change) {
    let entity = *slot.get_or_insert_with(|| mesh(world));
    let mut mesh = world.entity_mut(entity);
    match change {
        Change::Move(place) => {
            let place = GlobalTransform::from_translation(Vec3::from(place.map(f32::from)));
            mesh.insert(place);
        }
        Change::Grow(size) => {
            let half = Vec3::splat(0.5 * f32::from(*size));
            mesh.insert(Aabb::from_min_max(-half, half));
        }
        Change::Hide(true) => drop(mesh.insert(InheritedVisibility::HIDDEN)),
        Change::Hide(false) => drop(mesh.insert(InheritedVisibility::VISIBLE)),
        Change::Layer(layer) => drop(mesh.insert(RenderLayers::layer(*layer))),
        Change::Shade(true) => drop(mesh.insert(NotShadowCaster)),
        Change::Shade(false) => drop(mesh.remove::<NotShadowCaster>()),
        Change::Uncull(true) => drop(mesh.insert(NoFrustumCulling)),
        Change::Uncull(false) => drop(mesh.remove::<NoFrustumCulling>()),
        Change::Remove => {
            world.despawn(entity);
            *slot = None;
        }
    }
}

/// A camera with a cube of 8 m in front of it.
fn camera(world: &mut World) -> Entity {
    let lens = OrthographicProjection {
        near: 0.0,
        far: 8.0,
        scaling_mode: ScalingMode::Fixed { width: 8.0, height: 8.0 },
        ..OrthographicProjection::default_3d()
    };
    let mut projection = Projection::Orthographic(lens);
    projection.update(1.0, 1.0);
    world
        .spawn((
            Camera { is_active: true, ..Default::default() },
            projection,
            GlobalTransform::default(),
            RenderLayers::default(),
        ))
        .id()
}

proptest! {
    #[test]
    fn a_map_draws_what_casts_shadows_of_what_a_camera_in_its_place_sees(
        frames in prop::collection::vec(frame(), 1..24),
    ) {
        let mut app = App::new();
        app.init_resource::<MeshChanges>().init_resource::<GiFrame>();
        let set_active = |is_active: fn(&GiFrame) -> bool| {
            move |frame: Res<GiFrame>, mut maps: Query<&mut Camera, With<RsmView>>| {
                maps.iter_mut().for_each(|mut camera| camera.is_active = is_active(&frame));
            }
        };
        app.add_systems(
            Update,
            (
                set_active(|_| false),
                update_frusta,
                note_changes,
                check_visibility_cpu_culling,
                set_active(|frame| frame.maps),
                list.run_if(is_needed),
            )
                .chain(),
        );
        let world = app.world_mut();
        let (twin, map) = (camera(world), camera(world));
        let view = RsmView { light: twin, camera: None, face: 0 };
        let place = MapPlace(GlobalTransform::default());
        world.entity_mut(map).insert((view, place, MapMeshes::default()));
        let mut meshes = [None; 12];
        for frame in frames {
            let world = app.world_mut();
            for (index, change) in &frame.changes {
                apply(world, &mut meshes[*index], change);
            }
            for view in [twin, map] {
                if let Some(place) = frame.moves {
                    let place = 0.1 * Vec3::from(place.map(f32::from));
                    let place = GlobalTransform::from_translation(place);
                    world.entity_mut(view).insert((place, MapPlace(place)));
                }
                if let Some(layer) = frame.layer {
                    world.entity_mut(view).insert(RenderLayers::layer(layer));
                }
            }
            world.resource_mut::<GiFrame>().maps = frame.is_drawn;
            app.update();
            if !frame.is_drawn {
                continue;
            }
            let world = app.world();
            let seen = |view: Entity| {
                let visible = world.get::<VisibleEntities>(view).expect("a list");
                visible.get(TypeId::of::<Mesh3d>()).to_vec()
            };
            let (drawn, mut expected) = (seen(map), seen(twin));
            expected.retain(|mesh| !world.entity(*mesh).contains::<NotShadowCaster>());
            prop_assert!(drawn.is_sorted() && expected.iter().all(|mesh| drawn.contains(mesh)));
            let eye = world.get::<GlobalTransform>(map).expect("a place").translation();
            for mesh in &drawn {
                let mesh = world.entity(*mesh);
                prop_assert!(mesh.get::<ViewVisibility>().is_some_and(|visible| visible.get()));
                prop_assert!(!mesh.contains::<NotShadowCaster>());
                let bounds = mesh.get::<Aabb>().expect("a box");
                let center = mesh.get::<GlobalTransform>().expect("a place").translation() - eye;
                let outside = center.abs().truncate().max_element() - bounds.half_extents.x - 4.0;
                prop_assert!(mesh.contains::<NoFrustumCulling>() || outside < 2.0 * 13.9 * PADDING);
            }
        }
    }
}

//! The app's level: whether it is there, and holding it still.

use std::time::{Duration, Instant};

use bevy::app::App;
use bevy::asset::{AssetServer, Assets, UntypedAssetId};
use bevy::camera::{Camera, Camera3d, RenderTarget};
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, Skybox};
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::time::{Time, Virtual};
use bevy::transform::components::{GlobalTransform, Transform};
use bevy::world_serialization::WorldAssetRoot;

use super::StageError;
use crate::control::{FrontierSource, PowerController};
use crate::error_meter::ErrorMeter;
use crate::gi::FrugalGi;
use crate::knobs::{KnobSettings, WarmKnobs};
use crate::pacing::FrameRateLimit;

/// The level that the tool asks for, `frugal … --level NAME`. `None`: the app's first, or whatever it
/// shows without the tool.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq)]
pub struct StageLevel(pub Option<String>);

/// Whether the level is there. An app that inserts it is waited for until it is `Ready`; without it,
/// the level is there when there is a camera, every mesh, material, image and scene that entities name
/// has loaded, and none was added for a second (ten, while no entity has a mesh).
#[derive(Resource, Clone, Debug, PartialEq, Eq)]
pub enum StageReady {
    /// It is still being made.
    NotYet,
    /// It is there.
    Ready,
    /// It cannot be made, for a reason that the tool prints.
    Failed(String),
}

/// The camera to measure. Without one: the active 3D camera with [`FrugalGi`], else any active 3D
/// camera; of several that of the lowest order.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageCamera;

/// Pause between frames while the level is being made.
const YIELD: Duration = Duration::from_millis(5);
/// Time for which no asset was added to a level that is there, with and without a mesh.
const SETTLED: Duration = Duration::from_secs(1);
const SETTLED_EMPTY: Duration = Duration::from_secs(10);

/// Runs the app until its level is there, for at most so many seconds. Returns the camera.
pub(super) fn load(app: &mut App, seconds: f64) -> Result<Entity, StageError> {
    let start = Instant::now();
    let mut settled = (counts(app.world()), start);
    loop {
        app.update();
        if app.should_exit().is_some() {
            return Err(StageError::failed(StageError::ENDED));
        }
        let counted = counts(app.world());
        if counted != settled.0 {
            settled = (counted, Instant::now());
        }
        let missing = match missing(app.world_mut(), settled.1.elapsed())? {
            Ok(camera) => return Ok(camera),
            Err(missing) => missing,
        };
        if start.elapsed().as_secs_f64() > seconds {
            return Err(StageError::not_ready(format!(
                "after {seconds} s the app's level is not there: it waits for {missing}"
            )));
        }
        std::thread::sleep(YIELD);
    }
}

/// Numbers of what is loaded or made.
fn counts(world: &World) -> [usize; 3] {
    [
        world.get_resource::<Assets<Mesh>>().map_or(0, Assets::len),
        world.get_resource::<Assets<StandardMaterial>>().map_or(0, Assets::len),
        world.get_resource::<Assets<Image>>().map_or(0, Assets::len),
    ]
}

/// The camera of a level that is there, or what it still lacks, unchanged for a time.
fn missing(world: &mut World, unchanged: Duration) -> Result<Result<Entity, String>, StageError> {
    let camera = camera(world)?.ok_or_else(|| "an active `Camera3d`".to_owned());
    match world.get_resource::<StageReady>() {
        Some(StageReady::Failed(reason)) => return Err(StageError::usage(reason)),
        Some(StageReady::NotYet) => return Ok(Err("its `StageReady`".to_owned())),
        Some(StageReady::Ready) => return Ok(camera),
        None if camera.is_err() => return Ok(camera),
        None => {}
    }
    let mut named: Vec<UntypedAssetId> = Vec::new();
    let mut meshes = world.query::<(&Mesh3d, Option<&MeshMaterial3d<StandardMaterial>>)>();
    for (mesh, material) in meshes.iter(world) {
        named.push(mesh.id().untyped());
        named.extend(material.map(|material| material.id().untyped()));
    }
    let is_empty = named.is_empty();
    let mut skies = world.query::<(Option<&Skybox>, Option<&EnvironmentMapLight>)>();
    for (sky, light) in skies.iter(world) {
        named.extend(sky.and_then(|sky| Some(sky.image.as_ref()?.id().untyped())));
        let maps = light.map(|light| [light.diffuse_map.id(), light.specular_map.id()]);
        named.extend(maps.into_iter().flatten().map(|map| map.untyped()));
    }
    named.extend(world.query::<&WorldAssetRoot>().iter(world).map(|root| root.0.id().untyped()));
    if let Some(server) = world.get_resource::<AssetServer>() {
        // Those that the app has made itself have no state, and a file that is missing has one.
        let is_loading = |id: &UntypedAssetId| {
            server.get_recursive_dependency_load_state(*id).is_some_and(|state| state.is_loading())
        };
        let mut loading = named.into_iter().filter(is_loading);
        if let Some(first) = loading.next() {
            let path = server.get_path(first).map_or_else(String::new, |path| format!(" `{path}`"));
            return Ok(Err(format!("{} assets, such as{path}", loading.count() + 1)));
        }
    }
    let time = if is_empty { SETTLED_EMPTY } else { SETTLED };
    if unchanged < time {
        let time = time.as_secs();
        return Ok(Err(format!(
            "{time} s without new assets; insert `StageReady` where the app always makes some"
        )));
    }
    Ok(camera)
}

/// The camera to measure, if there is one yet.
fn camera(world: &mut World) -> Result<Option<Entity>, StageError> {
    let named: Vec<Entity> =
        world.query_filtered::<Entity, With<StageCamera>>().iter(world).collect();
    match named[..] {
        [] => {}
        [camera] => return Ok(world.get::<Camera>(camera).map(|_| camera)),
        _ => {
            let count = named.len();
            let message = format!("{count} entities have a `StageCamera`: leave it to one");
            return Err(StageError::usage(message));
        }
    }
    type Cameras = (Entity, &'static Camera, Has<FrugalGi>);
    // Cameras that a renderer adds for itself have no transform.
    let mut cameras = world.query_filtered::<Cameras, (With<Camera3d>, With<Transform>)>();
    let active = cameras.iter(world).filter(|(_, camera, _)| camera.is_active);
    let first = active.min_by_key(|(entity, camera, has_gi)| (!has_gi, camera.order, *entity));
    Ok(first.map(|(entity, ..)| entity))
}

/// What the stage decides in each frame, whatever the app does.
#[derive(Resource, Clone, Debug)]
pub(super) struct Held {
    /// The camera.
    camera: Entity,
    /// Its place.
    pub(super) place: Transform,
    /// Its settings.
    pub(super) settings: Option<KnobSettings>,
}

/// Takes the camera out of the app's hands, and stops what moves: the clock stands still, and every
/// other camera with a window is off. Returns the camera.
pub(super) fn hold(app: &mut App) -> Result<Entity, StageError> {
    let world = app.world_mut();
    let Some(camera) = camera(world)? else {
        return Err(StageError::usage("there is no active `Camera3d`"));
    };
    // Placed in the world, whatever it was part of. Its own parts follow it.
    world.entity_mut(camera).remove::<ChildOf>();
    let place = world.get::<GlobalTransform>(camera).map(GlobalTransform::compute_transform);
    let place = Transform { scale: bevy::math::Vec3::ONE, ..place.unwrap_or_default() };
    world.entity_mut(camera).insert(place);
    world.insert_resource(Held { camera, place, settings: None });
    Ok(camera)
}

/// Before settings are applied and transforms propagate.
pub(super) fn keep(world: &mut World) {
    let Some(held) = world.get_resource::<Held>().cloned() else { return };
    if let Some(mut time) = world.get_resource_mut::<Time<Virtual>>() {
        time.pause();
    }
    let mut controlled = world.query_filtered::<Entity, Or<(
        With<PowerController>,
        With<FrontierSource>,
        With<ErrorMeter>,
        With<WarmKnobs>,
    )>>();
    for camera in controlled.iter(world).collect::<Vec<_>>() {
        let mut camera = world.entity_mut(camera);
        camera.remove::<(PowerController, FrontierSource, ErrorMeter, WarmKnobs)>();
    }
    for (entity, mut camera, target) in
        world.query::<(Entity, &mut Camera, &RenderTarget)>().iter_mut(world)
    {
        let is_shown = matches!(target, RenderTarget::Window(_)) && entity != held.camera;
        if camera.is_active && is_shown {
            camera.is_active = false;
        }
    }
    let Ok(mut camera) = world.get_entity_mut(held.camera) else { return };
    if let Some(mut camera) = camera.get_mut::<Camera>()
        && (!camera.is_active || camera.viewport.is_some())
    {
        (camera.is_active, camera.viewport) = (true, None);
    }
    if let Some(mut transform) = camera.get_mut::<Transform>() {
        transform.set_if_neq(held.place);
    }
    if let Some(settings) = held.settings
        && camera.get::<KnobSettings>() != Some(&settings)
    {
        camera.insert(settings);
    }
}

/// After transforms have propagated: no system that ran beside [`keep`] has moved the camera.
pub(super) fn keep_place(held: Option<Res<Held>>, mut places: Query<&mut GlobalTransform>) {
    if let Some(held) = held
        && let Ok(mut place) = places.get_mut(held.camera)
    {
        place.set_if_neq(held.place.into());
    }
}

/// After settings are applied: the stage sleeps in no frame.
pub(super) fn keep_pace(held: Option<Res<Held>>, limit: Option<ResMut<FrameRateLimit>>) {
    if held.is_some()
        && let Some(mut limit) = limit
    {
        limit.set_if_neq(FrameRateLimit::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::knobs::KnobSpace;

    #[test]
    fn a_level_that_never_settles_is_named_with_the_remedy() {
        let mut world = World::new();
        let camera = world.spawn((Camera3d::default(), Transform::default())).id();
        let waits = missing(&mut world, SETTLED_EMPTY - SETTLED).expect("no fault");
        let waits = waits.expect_err("assets came lately");
        assert!(waits.starts_with("10 s") && waits.contains("`StageReady`"), "{waits}");
        assert_eq!(missing(&mut world, SETTLED_EMPTY), Ok(Ok(camera)));
    }

    #[test]
    fn nothing_of_the_app_sets_the_knobs() {
        let mut world = World::new();
        let warm = WarmKnobs::new(KnobSpace::default());
        let camera = world.spawn((Camera3d::default(), Transform::default(), warm)).id();
        let settings = KnobSettings { space: Default::default(), settings: Default::default() };
        let place = Transform::from_xyz(1.0, 2.0, 3.0);
        world.insert_resource(Held { camera, place, settings: Some(settings.clone()) });
        keep(&mut world);
        let camera = world.entity(camera);
        assert_eq!(camera.get::<KnobSettings>(), Some(&settings));
        assert_eq!(camera.get::<Transform>(), Some(&place));
        assert!(!camera.contains::<WarmKnobs>(), "it shows another level in each frame");
    }
}

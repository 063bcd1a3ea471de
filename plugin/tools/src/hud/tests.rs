//! The HUD in an app without a renderer.

use std::sync::Arc;
use std::time::Duration;

use bevy::asset::AssetEvent;
use bevy::camera::{Exposure, RenderTargetInfo, Viewport};
use bevy::ecs::message::Messages;
use bevy::light::VolumetricFog;
use bevy::light::{DirectionalLightShadowMap, PointLightShadowMap};
use bevy::pbr::{ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::time::TimeUpdateStrategy;
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, Selection};
use bevy_frugal_gi::error_meter::ErrorProbe;
use bevy_frugal_gi::frontier::{FrontierMap, FrontierMapPlugin};
use bevy_frugal_gi::knobs::{KnobLevels, KnobPlugin, KnobRegistry, KnobSettings};
use bevy_frugal_gi::units::Watts;

use super::panel::Panel;
use super::*;
use crate::testing;

/// An app with a map whose look-ups along −Z find points at 6 W / 0.2, 7 W / 0.05 and 9 W / 0, and
/// a camera with that view direction.
fn scene() -> (App, Entity) {
    let mut app = App::new();
    let plugins = (FrontierMapPlugin, ControlPlugin, HudPlugin);
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), plugins));
    app.init_asset::<Image>().init_resource::<ButtonInput<KeyCode>>();
    let frame = Duration::from_millis(125);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
    app.finish();
    app.cleanup();
    let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(testing::map());
    let lens = Projection::Perspective(PerspectiveProjection::default());
    let controlled = (PowerController(map), Budget::power(Watts(7.5)));
    let camera = app.world_mut().spawn((Camera::default(), lens, controlled)).id();
    (app, camera)
}

fn run(app: &mut App, frames: usize) {
    (0..frames).for_each(|_| app.update());
}

/// Summary, plot's text and knobs of a camera's panel.
fn texts(app: &mut App, camera: Entity) -> Option<[String; 3]> {
    let mut panels = app.world_mut().query::<&Panel>();
    let panel = panels.iter(app.world()).find(|panel| panel.camera == camera)?;
    let text = |entity| app.world().get::<Text>(entity).expect("a text").0.clone();
    Some([panel.summary, panel.log, panel.knobs].map(text))
}

fn parts(app: &mut App) -> usize {
    app.world_mut().query_filtered::<(), With<HudPart>>().iter(app.world()).count()
}

/// How often images have changed since the last call.
fn drawn(app: &mut App) -> usize {
    let mut events = app.world_mut().resource_mut::<Messages<AssetEvent<Image>>>();
    events.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count()
}

#[test]
fn the_text_follows_a_switch() {
    let (mut app, camera) = scene();
    run(&mut app, 2);
    let [summary, log, knobs] = texts(&mut app, camera).expect("a panel");
    assert!(summary.contains("7.50 W") && summary.contains("outcome   met"), "{summary}");
    assert!(summary.contains("predicted 7.00 W, error 0.0500"), "{summary}");
    assert_eq!(log, "3 points, 6.00..9.00 W, error 0.200..0.000");
    assert_eq!(knobs, "samples   3/5  8\nscale     1/3  0.5");

    app.world_mut().entity_mut(camera).insert(Budget::default());
    run(&mut app, 12);
    let [summary, log, knobs] = texts(&mut app, camera).expect("a panel");
    assert!(summary.contains("budget    none"), "{summary}");
    assert!(summary.contains("predicted 9.00 W, error 0.0000"), "{summary}");
    assert!(log.contains("samples 8 > 32, scale 0.5 > 1"), "{log}");
    assert_eq!(knobs, "samples   5/5  32\nscale     3/3  1");
}

#[test]
fn the_plot_is_drawn_where_it_changes_only() {
    let (mut app, camera) = scene();
    run(&mut app, 4);
    drawn(&mut app);
    for _ in 0..5 {
        app.update();
        assert_eq!(drawn(&mut app), 0);
    }
    app.world_mut().entity_mut(camera).insert(Budget::power(Watts(8.0)));
    let changes: usize = (0..3).map(|_| (app.update(), drawn(&mut app)).1).sum();
    assert_eq!(changes, 1, "another limit with the same settings");
}

#[test]
fn hidden_it_has_no_entities() {
    let (mut app, camera) = scene();
    run(&mut app, 2);
    assert_eq!(parts(&mut app), 2, "a camera and a panel");
    let entities = app.world().entities().count_spawned();
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::F3);
    run(&mut app, 1);
    assert_eq!((parts(&mut app), texts(&mut app, camera)), (0, None));
    assert!(app.world().entities().count_spawned() < entities - 4);
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().clear();
    run(&mut app, 3);
    assert_eq!(parts(&mut app), 0);
    app.world_mut().resource_mut::<HudSettings>().visible = true;
    run(&mut app, 1);
    assert!(texts(&mut app, camera).is_some());
    assert_eq!(app.world().entities().count_spawned(), entities);
}

#[test]
fn every_camera_with_settings_has_a_panel() {
    let (mut app, camera) = scene();
    let space = Arc::new(testing::space());
    let settings = KnobSettings { space, settings: KnobLevels::default() };
    let other = (Camera::default(), Name::new("left"), settings);
    let other = app.world_mut().spawn(other).id();
    let plain = app.world_mut().spawn(Camera::default()).id();
    run(&mut app, 2);
    assert_eq!((parts(&mut app), texts(&mut app, plain)), (3, None));
    let [summary, _, knobs] = texts(&mut app, other).expect("a panel");
    assert!(summary.starts_with("left\n") && summary.contains("settings by hand"), "{summary}");
    assert_eq!(knobs, "samples   1/5  0\nscale     1/3  0.5");

    app.world_mut().get_mut::<Camera>(other).expect("a camera").is_active = false;
    run(&mut app, 2);
    assert_eq!(texts(&mut app, other), None);
    let [summary, ..] = texts(&mut app, camera).expect("a panel");
    assert!(summary.starts_with("budget"), "one panel needs no name: {summary}");
    app.world_mut().entity_mut(camera).despawn();
    run(&mut app, 2);
    assert_eq!(parts(&mut app), 1, "its own camera");
}

#[test]
fn the_hidden_camera_of_an_error_meter_has_no_panel() {
    let (mut app, camera) = scene();
    run(&mut app, 2);
    let best = app.world().get::<KnobSettings>(camera).expect("settings").clone();
    app.world_mut().spawn((Camera::default(), ErrorProbe { camera }, best));
    run(&mut app, 1);
    assert_eq!(parts(&mut app), 2, "a camera and a panel");
}

#[test]
fn an_app_can_draw_it_by_a_camera_of_its_own() {
    let (mut app, _) = scene();
    let camera = app.world_mut().spawn(Camera2d).id();
    app.world_mut().resource_mut::<HudSettings>().camera = Some(camera);
    run(&mut app, 2);
    assert_eq!(parts(&mut app), 1);
    let mut roots = app.world_mut().query::<&UiTargetCamera>();
    assert_eq!(roots.single(app.world()).expect("a panel").0, camera);
    // As with a level: the HUD helps itself until the app names another.
    app.world_mut().entity_mut(camera).despawn();
    run(&mut app, 2);
    assert_eq!(parts(&mut app), 2, "a camera and a panel");
    assert_ne!(roots.single(app.world()).expect("a panel").0, camera);
    let next = app.world_mut().spawn(Camera2d).id();
    app.world_mut().resource_mut::<HudSettings>().camera = Some(next);
    run(&mut app, 2);
    assert_eq!(parts(&mut app), 1);
    assert_eq!(roots.single(app.world()).expect("a panel").0, next);
}

/// A component of the app's own.
#[derive(Component, Clone)]
struct Player;

fn seconds(app: &mut App) -> Vec<Entity> {
    let mut found = app.world_mut().query_filtered::<Entity, With<WipeCamera>>();
    found.iter(app.world()).collect()
}

fn place(app: &mut App, camera: Entity) -> (Transform, KnobLevels) {
    let knobs = app.world().get::<KnobSettings>(camera).expect("settings").settings;
    (*app.world().get::<Transform>(camera).expect("a transform"), knobs)
}

#[test]
fn a_wipe_shows_the_same_view_at_the_best_settings() {
    let (mut app, camera) = scene();
    app.world_mut().entity_mut(camera).insert((Player, Exposure { ev100: 3.0 }));
    let viewport = Viewport { physical_size: UVec2::new(64, 36), ..default() };
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = Some(viewport);
    run(&mut app, 2);
    assert!(seconds(&mut app).is_empty());
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::F4);
    run(&mut app, 1);
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().clear();
    run(&mut app, 2);
    let [second] = seconds(&mut app)[..] else { panic!("one wipe") };
    let moved = Transform::from_xyz(1.0, 2.0, 3.0);
    app.world_mut().entity_mut(camera).insert((moved, GlobalTransform::from(moved)));
    run(&mut app, 1);
    let space = Arc::clone(&app.world().get::<KnobSettings>(camera).expect("settings").space);
    assert_eq!(place(&mut app, second), (moved, space.highest()));
    assert_ne!(place(&mut app, camera).1, space.highest(), "the camera's own stay");
    let world = app.world();
    assert_eq!(world.get::<Exposure>(second).map(|exposure| exposure.ev100), Some(3.0));
    assert!(!world.entity(second).contains::<Player>(), "a query by it means one camera");
    assert!(!world.entity(second).contains::<Budget>(), "nothing controls it");

    // It outlives panels that are spawned anew, and leaves with the key or its camera.
    app.world_mut().resource_mut::<HudSettings>().visible = false;
    app.world_mut().resource_mut::<HudWipe>().at = Some(f32::NAN);
    run(&mut app, 2);
    assert_eq!(seconds(&mut app), [second]);
    app.world_mut().entity_mut(camera).despawn();
    run(&mut app, 2);
    assert!(seconds(&mut app).is_empty());
    let mut nodes = app.world_mut().query_filtered::<(), With<WipeNode>>();
    assert_eq!(nodes.iter(app.world()).count(), 0);
}

/// Lets a camera show the right half of a window of 1280 × 720.
fn show(app: &mut App, camera: Entity) {
    let mut camera = app.world_mut().get_mut::<Camera>(camera).expect("a camera");
    camera.computed.target_info =
        Some(RenderTargetInfo { physical_size: UVec2::new(1280, 720), scale_factor: 1.0 });
    let (physical_position, physical_size) = (UVec2::new(640, 0), UVec2::new(640, 720));
    camera.viewport = Some(Viewport { physical_position, physical_size, ..default() });
}

#[test]
fn parts_lie_over_their_viewport_whatever_the_scale_of_the_interface() {
    let (mut app, camera) = scene();
    app.insert_resource(UiScale(2.0));
    show(&mut app, camera);
    run(&mut app, 2);
    app.world_mut().resource_mut::<HudWipe>().at = Some(0.5);
    run(&mut app, 3);
    let mut panels = app.world_mut().query_filtered::<&Node, With<Panel>>();
    let panel = panels.single(app.world()).expect("a panel");
    assert_eq!((panel.left, panel.max_width, panel.max_height), (px(320), px(320), px(360)));
    let mut wipes = app.world_mut().query_filtered::<&Node, With<WipeNode>>();
    let wipe = wipes.single(app.world()).expect("a wipe");
    assert_eq!((wipe.left, wipe.width, wipe.height), (px(480), px(160), px(360)));
}

#[test]
fn a_wipe_leaves_nothing_where_the_app_despawns_its_camera() {
    let (mut app, camera) = scene();
    show(&mut app, camera);
    run(&mut app, 2);
    app.world_mut().resource_mut::<HudWipe>().at = Some(0.5);
    run(&mut app, 2);
    let [second] = seconds(&mut app)[..] else { panic!("one wipe") };
    // As all cameras of a level.
    app.world_mut().entity_mut(second).despawn();
    run(&mut app, 2);
    let mut nodes = app.world_mut().query_filtered::<(), With<WipeNode>>();
    assert_eq!((seconds(&mut app).len(), nodes.iter(app.world()).count()), (1, 1));
    app.world_mut().resource_mut::<HudWipe>().at = None;
    run(&mut app, 2);
    assert_eq!((seconds(&mut app).len(), nodes.iter(app.world()).count()), (0, 0));
}

#[test]
fn its_own_camera_is_there_while_it_draws() {
    let (mut app, camera) = scene();
    show(&mut app, camera);
    app.world_mut().resource_mut::<HudSettings>().visible = false;
    run(&mut app, 2);
    app.world_mut().resource_mut::<HudWipe>().at = Some(0.5);
    run(&mut app, 2);
    let mut own = app.world_mut().query_filtered::<Entity, (With<HudPart>, With<Camera2d>)>();
    let first = own.single(app.world()).expect("a camera");
    // As all cameras of a menu.
    app.world_mut().entity_mut(first).despawn();
    run(&mut app, 1);
    let second = own.single(app.world()).expect("a camera");
    let mut targets = app.world_mut().query::<&UiTargetCamera>();
    assert_eq!(targets.single(app.world()).expect("a node").0, second);
    app.world_mut().resource_mut::<HudWipe>().at = None;
    run(&mut app, 1);
    assert_eq!(parts(&mut app), 0);
}

#[test]
fn a_wipe_shows_what_knobs_took_away() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), KnobPlugin, HudPlugin))
        .init_asset::<Image>()
        .init_resource::<ButtonInput<KeyCode>>()
        .init_resource::<DirectionalLightShadowMap>()
        .init_resource::<PointLightShadowMap>();
    let all = app.world().resource::<KnobRegistry>().space().expect("a registry");
    let space = all.subset(["ambient_occlusion", "effects"]).expect("knobs");
    let settings = space.parse("ambient_occlusion=off,effects=low").expect("settings");
    let authored = (
        ScreenSpaceAmbientOcclusion::default(),
        ScreenSpaceReflections { linear_steps: 40, ..default() },
        VolumetricFog { step_count: 64, ..default() },
    );
    let knobs = KnobSettings { space: Arc::new(space), settings };
    let camera = (Camera::default(), Projection::default(), Selection::default());
    let camera = app.world_mut().spawn((camera, authored, knobs)).id();
    run(&mut app, 2);
    let looks = |app: &App, camera| {
        let steps = app.world().get::<ScreenSpaceReflections>(camera).map(|it| it.linear_steps);
        let fog = app.world().get::<VolumetricFog>(camera).map(|it| it.step_count);
        let has_occlusion = app.world().get::<ScreenSpaceAmbientOcclusion>(camera).is_some();
        (has_occlusion, steps, fog)
    };
    assert_eq!(looks(&app, camera), (false, Some(10), Some(16)));
    // Without a target there is no viewport, unless it is set.
    let viewport = Viewport { physical_size: UVec2::new(64, 36), ..default() };
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").viewport = Some(viewport);
    app.world_mut().resource_mut::<HudWipe>().at = Some(0.5);
    run(&mut app, 3);
    let [second] = seconds(&mut app)[..] else { panic!("one wipe") };
    assert_eq!(looks(&app, second), (true, Some(40), Some(64)), "the best settings");
    assert_eq!(looks(&app, camera), (false, Some(10), Some(16)), "the camera's own stay");
}

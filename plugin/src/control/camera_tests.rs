//! Tests of the controller in a Bevy app without a renderer.

use std::path::Path;
use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::{App, Update};
use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
use bevy::asset::{AssetApp, AssetPlugin, Handle};
use bevy::camera::{PerspectiveProjection, Projection};
use bevy::math::Vec3;
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::{GlobalTransform, Transform};
use frugal_core::testing;

use super::*;
use crate::control::{
    Budget, BudgetStateChanged, CameraPriority, ControlPlugin, KnobBounds, MapRejected, Outcome,
    SettingsSwitched,
};
use crate::frontier::{
    FrontierMapPlugin, FrontierStore, SampleRef, SceneIdentity, SharedKnobs, ViewDirection,
};
use crate::knobs::{KnobLevels, KnobSettings};
use crate::power::{MeterInfo, MeterState, Provenance};
use crate::signals::{BatteryLevel, BatterySettings, ThermalHeadroom};
use crate::units::{Joules, Watts};

const FRAME: Duration = Duration::from_millis(125);

/// How often change detection reported changed settings.
#[derive(Resource, Default)]
struct Changes(usize);

fn app_with(files: Dir) -> App {
    let mut app = App::new();
    let reader = move || Box::new(MemoryAssetReader { root: files.clone() }) as _;
    app.register_asset_source(AssetSourceId::Default, AssetSourceBuilder::new(reader));
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), FrontierMapPlugin, ControlPlugin));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(FRAME)).init_resource::<Changes>();
    app.insert_resource(BatterySettings { enabled: false });
    let count = |changed: Query<(), Changed<KnobSettings>>, mut changes: ResMut<Changes>| {
        changes.0 += changed.iter().count();
    };
    app.add_systems(Update, count);
    app.finish();
    app.cleanup();
    app
}

/// An app with a map whose look-ups along −Z find points at 6 W / 0.2, 7 W / 0.05 and 9 W / 0, and
/// a camera with that view direction.
fn scene(budget: Budget) -> (App, Entity, Handle<FrontierMap>) {
    let mut app = app_with(Dir::default());
    app.world_mut().resource_mut::<ControlSettings>().transition = Duration::from_secs(1);
    let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(testing::map(1));
    let camera = app
        .world_mut()
        .spawn((PowerController(map.clone()), budget, lens(), GlobalTransform::IDENTITY))
        .id();
    (app, camera, map)
}

fn lens() -> Projection {
    Projection::Perspective(PerspectiveProjection::default())
}

fn selection(app: &App, camera: Entity) -> Selection {
    *app.world().get::<Selection>(camera).expect("a selection")
}

fn predicted(app: &App, camera: Entity) -> Option<Watts> {
    app.world().get::<CameraState>(camera).expect("a state").predicted
}

fn applied(app: &App, camera: Entity) -> KnobLevels {
    app.world().get::<KnobSettings>(camera).expect("settings").settings
}

fn at(samples: usize, scale: usize) -> KnobLevels {
    KnobLevels::default().with_level(0, samples).with_level(1, scale)
}

fn run(app: &mut App, frames: usize) {
    (0..frames).for_each(|_| app.update());
}

fn set_budget(app: &mut App, camera: Entity, budget: Budget) {
    app.world_mut().entity_mut(camera).insert(budget);
}

#[test]
fn the_first_frame_applies_the_selection_at_once() {
    let (mut app, camera, map) = scene(Budget::power(Watts(7.5)));
    app.update();
    let picked = selection(&app, camera);
    assert_eq!(picked.status, ControlStatus::Active(Outcome::Met));
    assert_eq!(
        (picked.target, picked.applied, applied(&app, camera)),
        (at(2, 0), at(2, 0), at(2, 0))
    );
    assert_eq!(picked.predicted.map(|cost| (cost.power.0, cost.error)), Some((7.0, 0.05)));
    let sample = picked.sample.expect("a sample camera");
    assert_eq!(sample.direction, ViewDirection::NegativeZ);
    let maps = app.world().resource::<Assets<FrontierMap>>();
    let space = &app.world().get::<KnobSettings>(camera).expect("settings").space;
    assert_eq!(**space, maps.get(&map).expect("the map").knobs);
}

#[test]
fn a_new_budget_takes_a_second_and_cuts_act_at_once() {
    let (mut app, camera, _) = scene(Budget::power(Watts(6.0)));
    run(&mut app, 3);
    assert_eq!(applied(&app, camera), at(0, 0));
    set_budget(&mut app, camera, Budget::default());
    // Frames of 1/8 s; the first sees the new target at t = 0. Levels from (0, 0) to (4, 2), over 1
    // s:
    let mut seen = Vec::new();
    for frame in 0..=8 {
        app.update();
        let share = f64::from(frame) / 8.0;
        assert_eq!(
            applied(&app, camera),
            at((share * 4.0).round() as usize, (share * 2.0).round() as usize),
            "frame {frame}"
        );
        assert_eq!(selection(&app, camera).target, at(4, 2));
        assert_eq!(selection(&app, camera).applied, applied(&app, camera));
        seen.push(applied(&app, camera));
    }
    assert_eq!(seen.last(), Some(&at(4, 2)));
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    app.world_mut().get_mut::<SettingsFilter>(camera).expect("a filter").cut();
    app.update();
    assert_eq!(applied(&app, camera), at(0, 0));
    app.world_mut().resource_mut::<ControlSettings>().transition = Duration::ZERO;
    set_budget(&mut app, camera, Budget::default());
    app.update();
    assert_eq!(applied(&app, camera), at(4, 2));
}

#[test]
fn transitions_take_their_time_under_every_budget() {
    // Number of frames of a transition; the first sees the new target at t = 0.
    let frames_from = |app: &mut App, camera, to| {
        (0..100).take_while(|_| (app.update(), applied(app, camera) != to).1).count()
    };
    let (mut app, camera, _) = scene(Budget::default());
    app.update();
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    assert_eq!(frames_from(&mut app, camera, at(0, 0)), 8, "power falls");
    set_budget(&mut app, camera, Budget::power(Watts(9.0)));
    // The scale arrives at 1.5 of 2 levels, samples at 3.5 of 4: 0.875 s.
    assert_eq!(frames_from(&mut app, camera, at(4, 2)), 7, "and rises at the same rate");
    run(&mut app, 10);
    set_budget(&mut app, camera, Budget::error(0.2));
    assert_eq!(frames_from(&mut app, camera, at(0, 0)), 8, "under an error limit quality falls");
    run(&mut app, 10);
    set_budget(&mut app, camera, Budget::error(0.0));
    assert_eq!(frames_from(&mut app, camera, at(4, 2)), 7, "and rises at the same rate");
    // Other durations.
    *app.world_mut().resource_mut::<ControlSettings>() =
        ControlSettings { transition: Duration::ZERO, dwell: Duration::ZERO, ..Default::default() };
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    app.update();
    assert_eq!(applied(&app, camera), at(0, 0));
}

#[test]
fn change_detection_fires_only_when_settings_differ() {
    let (mut app, camera, _) = scene(Budget::power(Watts(7.5)));
    run(&mut app, 20);
    assert_eq!(app.world().resource::<Changes>().0, 1, "the insertion");
    let space = app.world().get::<KnobSettings>(camera).expect("settings").space.clone();
    set_budget(&mut app, camera, Budget::power(Watts(8.0)));
    run(&mut app, 20);
    assert_eq!(app.world().resource::<Changes>().0, 1, "another budget with the same selection");
    assert!(Arc::ptr_eq(&space, &app.world().get::<KnobSettings>(camera).expect("settings").space));
    set_budget(&mut app, camera, Budget::default());
    run(&mut app, 40);
    // Two levels of samples and two of scale, which change in the same two frames.
    assert_eq!(app.world().resource::<Changes>().0, 3);
}

#[test]
fn each_camera_gets_the_settings_of_its_own_view() {
    let (mut app, camera, map) = scene(Budget::power(Watts(6.5)));
    // Along +X the same settings cost 1, 2 and 4 W.
    let look =
        GlobalTransform::from(Transform::from_xyz(3.0, 1.5, -3.0).looking_to(Vec3::X, Vec3::Y));
    let other =
        app.world_mut().spawn((PowerController(map), Budget::power(Watts(6.5)), lens(), look)).id();
    app.update();
    assert_eq!((applied(&app, camera), applied(&app, other)), (at(0, 0), at(4, 2)));
    assert_eq!(
        selection(&app, other).sample.map(|sample| sample.position),
        Some(Vec3::new(4.0, 2.0, -4.0))
    );
}

#[test]
fn unmet_budgets_are_reported_and_invalid_ones_keep_the_settings() {
    let (mut app, camera, _) = scene(Budget::power(Watts(0.0)));
    app.update();
    assert_eq!(selection(&app, camera).status, ControlStatus::Active(Outcome::PowerCannotBeMet));
    assert_eq!(applied(&app, camera), at(0, 0));
    for invalid in
        [Budget::power(Watts(f64::NAN)), Budget::power(Watts(-1.0)), Budget::error(f64::NAN)]
    {
        set_budget(&mut app, camera, invalid);
        run(&mut app, 20);
        assert_eq!(selection(&app, camera).status, ControlStatus::Off(OffReason::InvalidBudget));
        assert_eq!((applied(&app, camera), selection(&app, camera).predicted), (at(0, 0), None));
    }
    set_budget(&mut app, camera, Budget::power(Watts(f64::INFINITY)));
    run(&mut app, 20);
    assert_eq!(selection(&app, camera).status, ControlStatus::Active(Outcome::Met));
    assert_eq!(applied(&app, camera), at(4, 2));
}

#[test]
fn a_released_camera_keeps_its_settings_and_can_return() {
    let (mut app, camera, map) = scene(Budget::power(Watts(6.0)));
    app.update();
    app.world_mut().entity_mut(camera).remove::<PowerController>();
    app.update();
    assert!(
        app.world().get::<Selection>(camera).is_none()
            && app.world().get::<SettingsFilter>(camera).is_none()
    );
    assert_eq!(applied(&app, camera), at(0, 0));
    app.world_mut().get_mut::<KnobSettings>(camera).expect("settings").settings = at(3, 1);
    run(&mut app, 3);
    assert_eq!(applied(&app, camera), at(3, 1), "the app's own settings");
    app.world_mut().entity_mut(camera).insert(PowerController(map));
    app.update();
    assert_eq!(applied(&app, camera), at(0, 0));
    // What the app writes over the controller's settings stays until it is released; from there the
    // filter moves step by step.
    app.world_mut().get_mut::<KnobSettings>(camera).expect("settings").settings = at(4, 2);
    run(&mut app, 10);
    assert_eq!(applied(&app, camera), at(4, 2));
    app.world_mut().get_mut::<KnobBounds>(camera).expect("bounds").clear();
    app.update();
    assert_eq!(applied(&app, camera), at(4, 2));
    // In a second, eight frames.
    let way = [(4, 2), (3, 2), (3, 1), (2, 1), (2, 1), (1, 1), (1, 0), (0, 0)];
    for expected in way.map(|(samples, scale)| at(samples, scale)) {
        app.update();
        assert_eq!(applied(&app, camera), expected);
    }
    app.world_mut().despawn(camera);
    app.update();
}

#[test]
fn inactive_cameras_are_left_alone() {
    let (mut app, camera, _) = scene(Budget::default());
    app.world_mut().entity_mut(camera).insert(Camera { is_active: false, ..Default::default() });
    app.update();
    assert_eq!(selection(&app, camera), Selection::default());
}

/// Messages of one kind so far.
/// Events of a kind since the last look.
#[derive(Resource)]
struct Seen<E>(Vec<E>);

fn watch<E: EntityEvent + Copy>(app: &mut App) {
    app.insert_resource(Seen::<E>(Vec::new()));
    app.add_observer(|event: On<E>, mut seen: ResMut<Seen<E>>| seen.0.push(*event));
}

fn seen<E: EntityEvent + Copy>(app: &mut App) -> Vec<E> {
    std::mem::take(&mut app.world_mut().resource_mut::<Seen<E>>().0)
}

#[test]
fn a_transition_is_not_met_before_it_arrives() {
    let (mut app, camera, _) = scene(Budget::default());
    app.update();
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    let mut seen = Vec::new();
    for _ in 0..10 {
        app.update();
        let found = selection(&app, camera);
        let predicted = found.predicted_applied.expect("a prediction").power.0;
        let is_met = found.status == ControlStatus::Active(Outcome::Met);
        assert_eq!(is_met, predicted <= 6.0, "{found:?}");
        assert_eq!(found.predicted.map(|cost| cost.power.0), Some(6.0));
        seen.push(found.status);
    }
    assert_eq!(seen[0], ControlStatus::Active(Outcome::Settling));
    assert_eq!(seen[9], ControlStatus::Active(Outcome::Met));
}

#[test]
fn switches_and_states_are_told_once() {
    let (mut app, camera, map) = scene(Budget::default());
    watch::<BudgetStateChanged>(&mut app);
    watch::<SettingsSwitched>(&mut app);
    watch::<MapRejected>(&mut app);
    app.update();
    let to = ControlStatus::Active(Outcome::Met);
    let first = BudgetStateChanged { camera, from: ControlStatus::Waiting, to };
    assert_eq!(seen::<BudgetStateChanged>(&mut app), [first]);
    assert_eq!(seen::<SettingsSwitched>(&mut app), [], "the first settings are no switch");
    app.world_mut().resource_mut::<ControlSettings>().transition = Duration::ZERO;
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    app.update();
    let switch = SettingsSwitched { camera, from: at(4, 2), to: at(0, 0), target: at(0, 0) };
    assert_eq!(seen::<SettingsSwitched>(&mut app), [switch]);
    for _ in 0..3 {
        app.update();
        assert_eq!(seen::<SettingsSwitched>(&mut app), []);
        assert_eq!(seen::<BudgetStateChanged>(&mut app), []);
    }
    let newer = FrontierMap { version: FrontierMap::VERSION + 1, ..testing::map(1) };
    *app.world_mut().resource_mut::<Assets<FrontierMap>>().get_mut(&map).expect("the map") = newer;
    app.update();
    let rejected = MapRejected { camera, reason: OffReason::MapInvalid };
    assert_eq!(seen::<MapRejected>(&mut app), [rejected]);
    app.update();
    assert_eq!(seen::<MapRejected>(&mut app), []);
}

#[test]
fn removing_both_sources_at_once_forgets_the_camera() {
    let (mut app, camera, _) = scene(Budget::default());
    let store = FrontierSource::new(testing::map(1));
    app.world_mut().entity_mut(camera).insert(store);
    app.update();
    app.world_mut().entity_mut(camera).remove::<(PowerController, FrontierSource)>();
    app.update();
    let camera = app.world().entity(camera);
    assert!(!camera.contains::<Selection>() && !camera.contains::<CameraState>());
    assert!(!camera.contains::<SettingsFilter>() && !camera.contains::<MapFit>());
}

#[path = "camera_field_tests.rs"]
mod field;
#[path = "camera_map_tests.rs"]
mod maps;
#[path = "camera_power_tests.rs"]
mod power;

//! Tests of the controller in a Bevy app without a renderer.

use std::path::Path;
use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::{App, Update};
use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
use bevy::asset::{AssetApp, AssetPlugin, Handle};
use bevy::camera::PerspectiveProjection;
use bevy::ecs::message::{Message, Messages};
use bevy::math::Vec3;
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::Transform;

use super::*;
use crate::control::{ControlPlugin, FeedbackState, Outcome};
use crate::frontier::{
    Corner, FrontierMapPlugin, SampleRef, SceneIdentity, ViewDirection, testing,
};
use crate::power::{MeterInfo, MeterState, Provenance};
use crate::signals::{BatteryLevel, ThermalHeadroom};
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
    let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(testing::map(1));
    let camera = app
        .world_mut()
        .spawn((FrontierMapHandle(map.clone()), budget, lens(), GlobalTransform::IDENTITY))
        .id();
    (app, camera, map)
}

fn lens() -> Projection {
    Projection::Perspective(PerspectiveProjection::default())
}

fn selection(app: &App, camera: Entity) -> Selection {
    *app.world().get::<Selection>(camera).expect("a selection")
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
    app.world_mut().resource_mut::<ControlSettings>().transition_seconds = 0.0;
    set_budget(&mut app, camera, Budget::default());
    app.update();
    assert_eq!(applied(&app, camera), at(4, 2));
}

#[test]
fn an_exceeded_power_budget_is_met_in_half_a_second() {
    // Number of frames of a transition; the first sees the new target at t = 0.
    let frames_from = |app: &mut App, camera, to| {
        (0..100).take_while(|_| (app.update(), applied(app, camera) != to).1).count()
    };
    let (mut app, camera, _) = scene(Budget::default());
    app.update();
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    assert_eq!(frames_from(&mut app, camera, at(0, 0)), 4, "power falls quickly");
    set_budget(&mut app, camera, Budget::power(Watts(9.0)));
    // The scale arrives at 1.5 of 2 levels, samples at 3.5 of 4: 0.875 s.
    assert_eq!(frames_from(&mut app, camera, at(4, 2)), 7, "and rises slowly");
    run(&mut app, 10);
    set_budget(&mut app, camera, Budget::error(0.2));
    assert_eq!(frames_from(&mut app, camera, at(0, 0)), 8, "under an error limit quality falls");
    run(&mut app, 10);
    set_budget(&mut app, camera, Budget::error(0.0));
    assert_eq!(frames_from(&mut app, camera, at(4, 2)), 7, "and rises at the same rate");
    // Other durations.
    *app.world_mut().resource_mut::<ControlSettings>() =
        ControlSettings { transition_seconds: 4.0, fall_seconds: 0.0 };
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
    let other = app
        .world_mut()
        .spawn((FrontierMapHandle(map), Budget::power(Watts(6.5)), lens(), look))
        .id();
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
fn a_map_with_unregistered_knobs_is_rejected() {
    let (mut app, camera, _) = scene(Budget::default());
    app.insert_resource(KnownKnobs(["samples".to_owned()].into()));
    app.update();
    assert_eq!(selection(&app, camera).status, ControlStatus::Off(OffReason::UnknownKnobs));
    assert!(app.world().get::<KnobSettings>(camera).is_none());
    app.world_mut().resource_mut::<KnownKnobs>().0.insert("scale".to_owned());
    app.update();
    assert_eq!(selection(&app, camera).status, ControlStatus::Active(Outcome::Met));
    assert_eq!(applied(&app, camera), at(4, 2));
}

#[test]
fn invalid_and_empty_maps_are_rejected_until_they_change() {
    let (mut app, camera, map) = scene(Budget::default());
    let change = |app: &mut App, new: FrontierMap| {
        let mut maps = app.world_mut().resource_mut::<Assets<FrontierMap>>();
        *maps.get_mut(&map).expect("the map") = new;
        app.update();
        selection(app, camera).status
    };
    app.update();
    let newer = FrontierMap { version: FrontierMap::VERSION + 1, ..testing::map(1) };
    assert_eq!(change(&mut app, newer), ControlStatus::Off(OffReason::MapInvalid));
    assert_eq!(applied(&app, camera), at(4, 2), "settings stay as they were");
    let mut empty = testing::map(1);
    empty.octree.corners.iter_mut().for_each(|corner| corner.frontiers = [Corner::UNKNOWN; 6]);
    assert_eq!(change(&mut app, empty), ControlStatus::Off(OffReason::NothingKnown));
    assert_eq!(change(&mut app, testing::map(1)), ControlStatus::Active(Outcome::Met));
    // Another knob space: its levels do not correspond to the old ones, so no transition is
    // possible.
    let mut other = testing::map(1);
    other.knobs = KnobSpace::new(
        testing::space()
            .knobs()
            .iter()
            .cloned()
            .chain([crate::knobs::Knob::new("new", [0.0, 1.0])])
            .collect(),
    )
    .expect("a space");
    assert_eq!(change(&mut app, other.clone()), ControlStatus::Active(Outcome::Met));
    assert_eq!(*app.world().get::<KnobSettings>(camera).expect("settings").space, other.knobs);
}

#[test]
fn a_released_camera_keeps_its_settings_and_can_return() {
    let (mut app, camera, map) = scene(Budget::power(Watts(6.0)));
    app.update();
    app.world_mut().entity_mut(camera).remove::<FrontierMapHandle>();
    app.update();
    assert!(
        app.world().get::<Selection>(camera).is_none()
            && app.world().get::<SettingsFilter>(camera).is_none()
    );
    assert_eq!(applied(&app, camera), at(0, 0));
    app.world_mut().get_mut::<KnobSettings>(camera).expect("settings").settings = at(3, 1);
    run(&mut app, 3);
    assert_eq!(applied(&app, camera), at(3, 1), "the app's own settings");
    app.world_mut().entity_mut(camera).insert(FrontierMapHandle(map));
    app.update();
    assert_eq!(applied(&app, camera), at(0, 0));
    // From settings that the app writes over the controller's, the filter moves step by step.
    app.world_mut().get_mut::<KnobSettings>(camera).expect("settings").settings = at(4, 2);
    app.update();
    assert_eq!(applied(&app, camera), at(4, 2));
    // Under a power limit they fall in 0.5 s, four frames.
    for expected in [at(3, 2), at(2, 1), at(1, 1), at(0, 0)] {
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
fn messages<M: Message + Copy>(app: &App) -> Vec<M> {
    app.world().resource::<Messages<M>>().iter_current_update_messages().copied().collect()
}

#[test]
fn a_transition_is_not_met_before_it_arrives() {
    let (mut app, camera, _) = scene(Budget::default());
    app.update();
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    let mut seen = Vec::new();
    for _ in 0..6 {
        app.update();
        let found = selection(&app, camera);
        let predicted = found.predicted_applied.expect("a prediction").power.0;
        let is_met = found.status == ControlStatus::Active(Outcome::Met);
        assert_eq!(is_met, predicted <= 6.0, "{found:?}");
        assert_eq!(found.predicted.map(|cost| cost.power.0), Some(6.0));
        seen.push(found.status);
    }
    assert_eq!(seen[0], ControlStatus::Active(Outcome::Settling));
    assert_eq!(seen[5], ControlStatus::Active(Outcome::Met));
}

#[test]
fn switches_and_states_are_told_once() {
    let (mut app, camera, map) = scene(Budget::default());
    app.update();
    let to = ControlStatus::Active(Outcome::Met);
    let first = BudgetStateChanged { camera, from: ControlStatus::Waiting, to };
    assert_eq!(messages::<BudgetStateChanged>(&app), [first]);
    assert_eq!(messages::<SettingsSwitched>(&app), [], "the first settings are no switch");
    app.world_mut().resource_mut::<ControlSettings>().fall_seconds = 0.0;
    set_budget(&mut app, camera, Budget::power(Watts(6.0)));
    app.update();
    let switch = SettingsSwitched { camera, from: at(4, 2), to: at(0, 0), target: at(0, 0) };
    assert_eq!(messages::<SettingsSwitched>(&app), [switch]);
    for _ in 0..3 {
        app.update();
        assert_eq!(messages::<SettingsSwitched>(&app), []);
        assert_eq!(messages::<BudgetStateChanged>(&app), []);
    }
    let newer = FrontierMap { version: FrontierMap::VERSION + 1, ..testing::map(1) };
    *app.world_mut().resource_mut::<Assets<FrontierMap>>().get_mut(&map).expect("the map") = newer;
    app.update();
    let rejected = MapRejected { camera, reason: OffReason::MapInvalid };
    assert_eq!(messages::<MapRejected>(&app), [rejected]);
    app.update();
    assert_eq!(messages::<MapRejected>(&app), []);
}

#[test]
fn removing_both_sources_at_once_forgets_the_camera() {
    let (mut app, camera, _) = scene(Budget::default());
    let store = FrontierSource::new(testing::map(1));
    app.world_mut().entity_mut(camera).insert(store);
    app.update();
    app.world_mut().entity_mut(camera).remove::<(FrontierMapHandle, FrontierSource)>();
    app.update();
    let camera = app.world().entity(camera);
    assert!(!camera.contains::<Selection>() && !camera.contains::<CameraState>());
    assert!(!camera.contains::<SettingsFilter>() && !camera.contains::<MapFit>());
}

#[test]
fn a_map_that_does_not_fit_says_so() {
    let (mut app, camera, _) = scene(Budget::default());
    app.update();
    let fit = |app: &App| *app.world().get::<MapFit>(camera).expect("a fit");
    assert_eq!(fit(&app).outside, Some(0.0));
    assert!(!fit(&app).has(Misfit::Outside) && !fit(&app).has(Misfit::Scene));
    app.world_mut().insert_resource(ShownScene(SceneIdentity {
        name: "another".into(),
        fingerprint: "ab".into(),
    }));
    let far = GlobalTransform::from(Transform::from_xyz(0.0, 12.0, 0.0));
    app.world_mut().entity_mut(camera).insert(far);
    // The map is of 30 Hz, and this app runs at 8 Hz.
    run(&mut app, 10);
    let misfits: Vec<_> = fit(&app).misfits().collect();
    assert!(misfits.contains(&Misfit::Scene) && misfits.contains(&Misfit::FrameRate));
    assert_eq!(fit(&app).outside, Some(10.0));
}

#[test]
fn an_app_budget_is_divided_among_its_cameras() {
    let (mut app, camera, map) = scene(Budget::default());
    // Along −Z 6, 7 and 9 W, along +X 1, 2 and 4 W, of errors 0.2, 0.05 and 0.
    let look =
        GlobalTransform::from(Transform::from_xyz(3.0, 1.5, -3.0).looking_to(Vec3::X, Vec3::Y));
    let other =
        app.world_mut().spawn((FrontierMapHandle(map), Budget::default(), lens(), look)).id();
    app.world_mut().resource_mut::<ControlSettings>().transition_seconds = 0.0;
    app.world_mut().resource_mut::<ControlSettings>().fall_seconds = 0.0;
    let powers = |app: &mut App, limit: Option<f64>| {
        app.world_mut().resource_mut::<AppBudget>().power = limit.map(Watts);
        app.update();
        [camera, other]
            .map(|camera| selection(app, camera).predicted.expect("a prediction").power.0)
    };
    assert_eq!(powers(&mut app, None), [9.0, 4.0]);
    assert_eq!(powers(&mut app, Some(13.0)), [9.0, 4.0]);
    assert_eq!(powers(&mut app, Some(9.5)), [7.0, 2.0]);
    assert_eq!(powers(&mut app, Some(7.5)), [6.0, 1.0]);
    assert_eq!(selection(&app, camera).status, ControlStatus::Active(Outcome::Met));
    assert_eq!(powers(&mut app, Some(6.5)), [6.0, 1.0]);
    for camera in [camera, other] {
        let status = selection(&app, camera).status;
        assert_eq!(status, ControlStatus::Active(Outcome::PowerCannotBeMet));
    }
    // By priority, and within a camera's own budget.
    for (first, expected) in [(100.0, [9.0, 2.0]), (0.01, [7.0, 4.0])] {
        app.world_mut().entity_mut(camera).insert(CameraPriority(first));
        assert_eq!(powers(&mut app, Some(11.0)), expected);
    }
    set_budget(&mut app, other, Budget::power(Watts(2.5)));
    assert_eq!(powers(&mut app, Some(11.0)), [9.0, 2.0]);
    // An error limit that the app's budget does not allow is told.
    set_budget(&mut app, camera, Budget::error(0.0));
    assert_eq!(powers(&mut app, Some(9.5)), [7.0, 2.0]);
    let status = selection(&app, camera).status;
    assert_eq!(status, ControlStatus::Active(Outcome::LimitedByPower));
    for ignored in [f64::NAN, -1.0, f64::INFINITY] {
        assert_eq!(powers(&mut app, Some(ignored)), [9.0, 2.0], "{ignored}");
    }
}

/// A reading of `watts` over the last frame.
fn read(app: &mut App, watts: Option<f64>) {
    let mut metered = app.world_mut().get_resource_or_init::<MeteredPower>();
    let state = if watts.is_some() {
        MeterState::Running
    } else {
        MeterState::Lost { reason: "unplugged".into() }
    };
    *metered = MeteredPower {
        latest: watts.map(Watts),
        mean: watts.map(Watts),
        interval_seconds: watts.map(|_| FRAME.as_secs_f64()),
        sample_count: metered.sample_count + 1,
        info: Some(MeterInfo {
            name: "simulated".into(),
            provenance: Provenance::Measured,
            description: String::new(),
        }),
        state,
        read_at: None,
    };
    app.update();
}

#[test]
fn a_budget_is_held_on_a_device_that_is_hungrier_than_the_maps() {
    let (mut app, camera, _) = scene(Budget::power(Watts(10.0)));
    run(&mut app, 3);
    let feedback = |app: &App| *app.world().resource::<PowerFeedback>();
    assert_eq!((feedback(&app).state, applied(&app, camera)), (FeedbackState::Off, at(4, 2)));
    // 9 W by the map, 13.5 W by the meter; 6 W by the map is within 10 W.
    for _ in 0..24 {
        let predicted = app
            .world()
            .get::<CameraState>(camera)
            .and_then(CameraState::predicted)
            .flatten()
            .expect("a prediction");
        read(&mut app, Some(1.5 * predicted.0));
    }
    assert_eq!(feedback(&app).state, FeedbackState::Running);
    let found = selection(&app, camera);
    assert_eq!(found.status, ControlStatus::Active(Outcome::Met));
    assert_eq!(applied(&app, camera), at(0, 0));
    let predicted = found.predicted_applied.expect("a prediction").power.0;
    assert!((predicted / 9.0 - 1.0).abs() < 0.05, "{predicted} W, corrected");
    // A lost meter leaves its correction, and a disabled one nothing.
    read(&mut app, None);
    run(&mut app, 8);
    assert_eq!((feedback(&app).state, applied(&app, camera)), (FeedbackState::Held, at(0, 0)));
    app.world_mut().resource_mut::<PowerFeedback>().is_enabled = false;
    run(&mut app, 20);
    assert_eq!((feedback(&app).state, applied(&app, camera)), (FeedbackState::Off, at(4, 2)));
}

#[test]
fn a_modelled_meter_other_than_the_maps_is_not_trusted() {
    let (mut app, camera, _) = scene(Budget::power(Watts(10.0)));
    run(&mut app, 3);
    for name in ["other", "cpu-time"] {
        for _ in 0..12 {
            let mut metered = app.world_mut().get_resource_or_init::<MeteredPower>();
            *metered = MeteredPower {
                latest: Some(Watts(20.0)),
                interval_seconds: Some(FRAME.as_secs_f64()),
                sample_count: metered.sample_count + 1,
                info: Some(MeterInfo {
                    name: name.into(),
                    provenance: Provenance::Modelled,
                    description: String::new(),
                }),
                state: MeterState::Running,
                ..Default::default()
            };
            app.update();
        }
        let is_map_meter = name == "cpu-time";
        let state = app.world().resource::<PowerFeedback>().state;
        assert_eq!(state == FeedbackState::Running, is_map_meter, "{name}: {state:?}");
        assert_eq!(applied(&app, camera) == at(0, 0), is_map_meter, "{name}");
    }
}

#[test]
fn any_store_can_replace_the_map() {
    struct OneForAll(FrontierMap);
    impl FrontierStore for OneForAll {
        fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>> {
            self.0.look_up(&CameraView { position: Vec3::ZERO, ..*view })
        }
        fn knobs(&self) -> &KnobSpace {
            &self.0.knobs
        }
    }
    let (mut app, camera, map) = scene(Budget::power(Watts(6.5)));
    app.world_mut().resource_mut::<Assets<FrontierMap>>().remove(&map);
    app.world_mut().entity_mut(camera).insert(FrontierSource::new(OneForAll(testing::map(0))));
    app.update();
    assert_eq!(
        (selection(&app, camera).status, applied(&app, camera)),
        (ControlStatus::Active(Outcome::Met), at(0, 0))
    );
    app.world_mut().entity_mut(camera).remove::<FrontierSource>();
    app.update();
    assert_eq!(
        selection(&app, camera).status,
        ControlStatus::Waiting,
        "the map's handle is still there"
    );
}

/// Runs frames until the camera's status is no longer `from`.
fn run_while(app: &mut App, camera: Entity, from: ControlStatus) -> ControlStatus {
    for _ in 0..2_000 {
        app.update();
        if selection(app, camera).status != from {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    selection(app, camera).status
}

#[test]
fn maps_are_loaded_from_files_and_reloaded_when_those_change() {
    let files = Dir::default();
    let path = Path::new("maps/courtyard.pareto.ron");
    files.insert_asset_text(path, &testing::map(1).to_ron().expect("writable"));
    let mut app = app_with(files.clone());
    let server = app.world().resource::<AssetServer>().clone();
    let handle = FrontierMapHandle(server.load("maps/courtyard.pareto.ron"));
    let camera = app
        .world_mut()
        .spawn((handle, Budget::power(Watts(6.5)), lens(), GlobalTransform::IDENTITY))
        .id();
    assert_eq!(
        run_while(&mut app, camera, ControlStatus::Waiting),
        ControlStatus::Active(Outcome::Met)
    );
    assert_eq!(applied(&app, camera), at(0, 0));
    // The new file's frontiers all cost more than the budget.
    let mut dear = testing::map(1);
    dear.octree.frontiers.iter_mut().for_each(|frontier| *frontier = testing::frontier(50.0));
    files.insert_asset_text(path, &dear.to_ron().expect("writable"));
    server.reload("maps/courtyard.pareto.ron");
    let after = run_while(&mut app, camera, ControlStatus::Active(Outcome::Met));
    assert_eq!(after, ControlStatus::Active(Outcome::PowerCannotBeMet));
}

#[test]
fn files_that_do_not_load_turn_the_controller_off() {
    let files = Dir::default();
    let text = testing::map(1).to_ron().expect("writable");
    files.insert_asset_text(Path::new("half.pareto.ron"), &text[..text.len() / 2]);
    files
        .insert_asset_text(Path::new("newer.pareto.ron"), &text.replace("version:1", "version:99"));
    files.insert_asset(Path::new("binary.pareto.ron"), vec![0xff_u8; 40]);
    for file in ["half.pareto.ron", "newer.pareto.ron", "binary.pareto.ron", "missing.pareto.ron"] {
        let mut app = app_with(files.clone());
        let handle = FrontierMapHandle(app.world().resource::<AssetServer>().load(file));
        let camera = app.world_mut().spawn((handle, lens(), GlobalTransform::IDENTITY)).id();
        assert_eq!(
            run_while(&mut app, camera, ControlStatus::Waiting),
            ControlStatus::Off(OffReason::MapNotLoaded),
            "{file}"
        );
        assert!(app.world().get::<KnobSettings>(camera).is_none());
    }
}

#[test]
fn limits_of_other_currencies_are_kept_and_named() {
    // Points at 6 W, 7 W and 9 W.
    let named = |app: &App, camera| {
        let found = selection(app, camera);
        (found.predicted.map(|cost| cost.power.0), found.binding, found.status)
    };
    let met = ControlStatus::Active(Outcome::Met);
    let cannot = ControlStatus::Active(Outcome::PowerCannotBeMet);
    let (mut app, camera, map) = scene(Budget::default());
    run(&mut app, 2);
    assert_eq!(named(&app, camera), (Some(9.0), None, met));
    let rate = {
        let maps = app.world().resource::<Assets<FrontierMap>>();
        maps.get(&map).expect("the map").capture.frames_per_second
    };
    set_budget(&mut app, camera, Budget::default().with_energy_per_frame(Joules(7.5 / rate)));
    run(&mut app, 20);
    assert_eq!(named(&app, camera), (Some(7.0), Some(Limit::EnergyPerFrame), met));
    // Twenty minutes at 6.5 W, or at none.
    let until = Duration::from_secs_f64(app.world().resource::<Time<Real>>().elapsed_secs_f64());
    set_budget(
        &mut app,
        camera,
        Budget::default().with_battery_until(until + Duration::from_secs(1200)),
    );
    for (joules, watts, binding, status) in [
        (f64::NAN, 9.0, None, met),
        (6.5 * 1200.0, 6.0, Some(Limit::Battery), met),
        (1e9, 9.0, None, met),
        (0.0, 6.0, Some(Limit::Battery), cannot),
    ] {
        let energy = Some(Joules(joules));
        app.insert_resource(BatteryLevel { is_automatic: false, energy, power: None });
        run(&mut app, 20);
        assert_eq!(named(&app, camera), (Some(watts), binding, status), "{joules} J");
    }
    set_budget(&mut app, camera, Budget::default().with_headroom(0.5));
    app.insert_resource(ThermalHeadroom { share: Some(0.2) });
    run(&mut app, 20);
    assert_eq!(named(&app, camera), (Some(7.0), Some(Limit::Headroom), met), "6 + 0.4 × 3 W");
    set_budget(&mut app, camera, Budget::default().with_headroom(f64::NAN));
    run(&mut app, 2);
    assert_eq!(
        selection(&app, camera).status,
        ControlStatus::Off(OffReason::InvalidBudget),
        "refused with a message"
    );
}

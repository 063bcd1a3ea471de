//! Maps and other stores: refused, replaced, and loaded from files.

use super::*;
use crate::knobs::{Knob, KnobDriver, Level, RegisterKnob};

struct Named(&'static str);

impl KnobDriver for Named {
    fn knob(&self) -> Knob {
        Knob::new(self.0, [0.0])
    }

    fn apply(&self, _: &mut World, _: Entity, _: &Level) {}
}

#[test]
fn a_map_with_unregistered_knobs_is_rejected() {
    let (mut app, camera, _) = scene(Budget::default());
    app.register_knob(Named("samples"));
    app.update();
    assert_eq!(selection(&app, camera).status, ControlStatus::Off(OffReason::UnknownKnobs));
    assert!(app.world().get::<KnobSettings>(camera).is_none());
    app.register_knob(Named("scale"));
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
    empty.octree.frontiers.fill(Frontier::default());
    assert_eq!(change(&mut app, empty), ControlStatus::Off(OffReason::NothingKnown));
    assert_eq!(change(&mut app, testing::map(1)), ControlStatus::Active(Outcome::Met));
    // Another knob space: its levels do not correspond to the old ones, so no transition is
    // possible.
    let mut other = testing::map(1);
    other.knobs = KnobSpace::new(
        testing::space().knobs().iter().cloned().chain([Knob::new("new", [0.0, 1.0])]).collect(),
    )
    .expect("a space");
    assert_eq!(change(&mut app, other.clone()), ControlStatus::Active(Outcome::Met));
    assert_eq!(*app.world().get::<KnobSettings>(camera).expect("settings").space, other.knobs);
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
    let handle = PowerController(server.load("maps/courtyard.pareto.ron"));
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
        let handle = PowerController(app.world().resource::<AssetServer>().load(file));
        let camera = app.world_mut().spawn((handle, lens(), GlobalTransform::IDENTITY)).id();
        assert_eq!(
            run_while(&mut app, camera, ControlStatus::Waiting),
            ControlStatus::Off(OffReason::MapNotLoaded),
            "{file}"
        );
        assert!(app.world().get::<KnobSettings>(camera).is_none());
    }
}

//! Limits of the whole app and in other currencies, and metered power.

use super::*;

#[test]
fn an_app_budget_is_divided_among_its_cameras() {
    let (mut app, camera, map) = scene(Budget::default());
    // Along −Z 6, 7 and 9 W, along +X 1, 2 and 4 W, of errors 0.2, 0.05 and 0.
    let look =
        GlobalTransform::from(Transform::from_xyz(3.0, 1.5, -3.0).looking_to(Vec3::X, Vec3::Y));
    let other = app.world_mut().spawn((PowerController(map), Budget::default(), lens(), look)).id();
    app.world_mut().resource_mut::<ControlSettings>().transition = Duration::ZERO;
    app.world_mut().resource_mut::<ControlSettings>().dwell = Duration::ZERO;
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

#[test]
fn what_is_spent_without_an_app_budget_is_not_held_against_it() {
    let (mut app, camera, _) = scene(Budget::default());
    let mut powers = |limit: Option<f64>, seconds: usize| -> Vec<f64> {
        app.world_mut().resource_mut::<AppBudget>().power = limit.map(Watts);
        let frame = |number: usize| {
            // A view that moves.
            let place = GlobalTransform::from_xyz(0.5 * (number % 2) as f32, 0.0, 0.0);
            app.world_mut().entity_mut(camera).insert(place);
            app.update();
            selection(&app, camera).predicted_applied.expect("a prediction").power.0
        };
        (0..8 * seconds).map(frame).collect()
    };
    let before = powers(Some(7.5), 60);
    assert!(powers(None, 300)[80..].iter().all(|power| *power == 9.0));
    let after = powers(Some(7.5), 60);
    let mean = |powers: &[f64]| powers.iter().sum::<f64>() / powers.len() as f64;
    assert!(mean(&after[80..]) > 0.97 * mean(&before[80..]), "{before:?} {after:?}");
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
        interval: watts.map(|_| FRAME),
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

/// Makes the app's frame rate `share` times the map's.
fn rate(app: &mut App, map: &Handle<FrontierMap>, share: f64) {
    let mut maps = app.world_mut().resource_mut::<Assets<FrontierMap>>();
    let map = &mut *maps.get_mut(map).expect("the map");
    map.capture.frames_per_second = 1.0 / (FRAME.as_secs_f64() * share);
    map.work_prices.idle = Watts(2.0);
}

#[test]
fn a_frame_rate_below_the_maps_leaves_room_for_better_settings() {
    // 2 W idle and 4, 5 or 7 W of frames by the map; the app has half the frames.
    for (limit, expected) in [(4.6, at(2, 0)), (5.6, at(4, 2))] {
        let (mut app, camera, map) = scene(Budget::power(Watts(limit)));
        rate(&mut app, &map, 0.5);
        run(&mut app, 12);
        assert_eq!(applied(&app, camera), at(0, 0), "without a meter, watts are the map's");
        for _ in 0..40 {
            let predicted = predicted(&app, camera).expect("a prediction");
            read(&mut app, Some(2.0 + 0.5 * (predicted.0 - 2.0)));
        }
        let feedback = *app.world().resource::<PowerFeedback>();
        assert_eq!(applied(&app, camera), expected, "{limit} W: {feedback:?}");
        let found = selection(&app, camera).predicted_applied.expect("a prediction").power.0;
        assert!(found <= limit && (feedback.correction.gain - 0.5).abs() < 0.05, "{feedback:?}");
    }
}

#[test]
fn a_peak_is_held_on_a_device_that_is_hungrier_than_the_maps() {
    let (mut app, camera, map) = scene(Budget::default().with_peak(Watts(10.0)));
    rate(&mut app, &map, 1.0);
    run(&mut app, 3);
    let feedback = |app: &App| *app.world().resource::<PowerFeedback>();
    assert_eq!((feedback(&app).state, applied(&app, camera)), (FeedbackState::Off, at(4, 2)));
    // 9 W by the map, 13.5 W by the meter; 6 W by the map is within 10 W.
    for _ in 0..24 {
        let predicted = predicted(&app, camera).expect("a prediction");
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
    app.world_mut().resource_mut::<ControlSettings>().power_feedback = false;
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
                interval: Some(FRAME),
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
        let found = (applied(&app, camera), *app.world().resource::<PowerFeedback>());
        assert_eq!(found.0 == at(0, 0), is_map_meter, "{name}: {found:?}");
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
        app.insert_resource(BatteryLevel { energy, power: None });
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

#[test]
fn a_knob_of_the_app_is_agreed_on_and_paid_by_every_camera() {
    let (mut app, camera, map) = scene(Budget::default());
    {
        // The second knob is kept once for the app: each level takes 1 W of every camera.
        let mut maps = app.world_mut().resource_mut::<Assets<FrontierMap>>();
        let map = &mut *maps.get_mut(&map).expect("the map");
        let joules = [0.0, 1.0, 2.0].map(|watts| watts / map.capture.frames_per_second).to_vec();
        map.work_prices.shared = SharedKnobs { names: vec!["scale".into()], joules };
        assert_eq!(map.validate(), Ok(()));
    }
    // Along −Z 6, 7 and 9 W, along +X 1, 2 and 4 W, of errors 0.2, 0.05 and 0; the best ones ask for
    // the second knob's highest level.
    let look =
        GlobalTransform::from(Transform::from_xyz(3.0, 1.5, -3.0).looking_to(Vec3::X, Vec3::Y));
    let limited = Budget::power(Watts(3.0));
    let other = app.world_mut().spawn((PowerController(map), limited, lens(), look)).id();
    let mut settings = app.world_mut().resource_mut::<ControlSettings>();
    settings.transition = Duration::ZERO;
    settings.dwell = Duration::ZERO;
    let powers = |app: &mut App, priority: f64, limit: f64| {
        app.world_mut().entity_mut(camera).insert(CameraPriority(priority));
        set_budget(app, other, Budget::power(Watts(limit)));
        app.update();
        [camera, other]
            .map(|camera| selection(app, camera).predicted_applied.expect("a prediction").power.0)
    };
    let met = ControlStatus::Active(Outcome::Met);
    // For both 7 + 2 W at 0.05; at the highest level it would be 9 W at 0, and 1 + 2 W at 0.2.
    assert_eq!(powers(&mut app, 1.0, 3.0), [7.0, 2.0]);
    assert_eq!(powers(&mut app, 100.0, 3.0), [9.0, 3.0], "the other pays for it");
    assert_eq!(powers(&mut app, f64::INFINITY, 3.0), [9.0, 3.0]);
    assert_eq!(powers(&mut app, 1.0, 4.0), [9.0, 4.0], "2 + 2 W, or 4 W of its own");
    // A limit is kept however much another camera would gain.
    assert_eq!(powers(&mut app, 1e6, 1.5), [7.0, 1.0]);
    assert_eq!([camera, other].map(|camera| selection(&app, camera).status), [met; 2]);
    // One that cannot be kept is told.
    powers(&mut app, 1.0, 0.5);
    let cannot = ControlStatus::Active(Outcome::PowerCannotBeMet);
    assert_eq!([camera, other].map(|camera| selection(&app, camera).status), [met, cannot]);
    // Within the app's budget as well: 7 + 2 W, where 9 + 3 W do not fit.
    app.world_mut().resource_mut::<AppBudget>().power = Some(Watts(11.5));
    assert_eq!(powers(&mut app, 100.0, 3.0), [7.0, 2.0]);
    app.world_mut().resource_mut::<AppBudget>().power = Some(Watts(12.5));
    assert_eq!(powers(&mut app, 100.0, 3.0), [9.0, 3.0]);
}

/// A camera that looks the one way for a second and the other way for the next, while the meter reads
/// the prediction times a factor for each way. Returns whether the scene counts as another than the
/// map's after `seconds`.
fn looks_about(app: &mut App, camera: Entity, factors: [f64; 2], seconds: usize) -> bool {
    let look =
        GlobalTransform::from(Transform::from_xyz(3.0, 1.5, -3.0).looking_to(Vec3::X, Vec3::Y));
    let ways = [GlobalTransform::IDENTITY, look];
    for second in 0..seconds {
        app.world_mut().entity_mut(camera).insert(ways[second % 2]);
        for _ in 0..8 {
            let predicted = predicted(app, camera).map_or(6.0, |watts| watts.0);
            read(app, Some(predicted * factors[second % 2]));
        }
    }
    app.world().resource::<PowerFeedback>().has_left_map
}

#[test]
fn a_scene_that_is_no_longer_the_maps_is_noticed_and_selected_for_more_carefully() {
    let (mut app, camera, map) = scene(Budget::power(Watts(30.0)));
    rate(&mut app, &map, 1.0);
    let overall = testing::frontier(11.0);
    let mut maps = app.world_mut().resource_mut::<Assets<FrontierMap>>();
    maps.get_mut(&map).expect("the map").shared = overall.clone();
    assert!(!looks_about(&mut app, camera, [1.4, 1.4], 30), "another device");
    assert!(!looks_about(&mut app, camera, [0.95, 1.05], 30), "a map that is off by 5 %");
    assert!(looks_about(&mut app, camera, [0.5, 1.8], 40), "another scene");
    // From the frontier over all views, at more than the meter says.
    let feedback = *app.world().resource::<PowerFeedback>();
    let found = selection(&app, camera);
    let predicted = found.predicted.expect("a prediction");
    let points = overall.points();
    let own = points.iter().find(|point| point.settings == found.target).expect("a point");
    let expected = feedback.correction.corrected(own.cost.power).0;
    assert!((predicted.power.0 / expected - 1.0).abs() < 1e-9, "{predicted:?}, {feedback:?}");
    assert_eq!(predicted.error, own.cost.error);
    assert!(!looks_about(&mut app, camera, [1.0, 1.0], 60), "the scene is back");
}

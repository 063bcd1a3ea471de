//! Signals that are missing, slow and idle apps, and knobs that players pin.

use super::*;
use crate::control::Outcome;
use crate::power::{MeterInfo, MeterState, Provenance};
use crate::signals::{BatteryLevel, FrameTime, ThermalHeadroom};
use crate::units::Joules;
use frugal_core::testing;

const SECOND: Duration = Duration::from_secs(1);

/// An app under a map of twenty settings from 4 W to 14 W, at 60 frames per second.
fn steps(budget: Budget) -> (App, Entity) {
    let mut app = app_with(Dir::default());
    let mut map = testing::steps();
    map.capture.frames_per_second = 60.0;
    let source = FrontierSource::new(map);
    let camera = app.world_mut().spawn((source, budget, lens(), GlobalTransform::IDENTITY)).id();
    frame(&mut app, 1.0 / 60.0);
    (app, camera)
}

/// How long the next frames take, seconds.
fn frame(app: &mut App, seconds: f64) {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(seconds)));
}

/// The map's power of the applied settings.
fn drawn(app: &App, camera: Entity) -> f64 {
    predicted(app, camera).expect("a prediction").0
}

fn read(app: &mut App, watts: f64, seconds: f64) {
    let mut metered = app.world_mut().get_resource_or_init::<MeteredPower>();
    metered.latest = Some(Watts(watts));
    metered.interval = Some(Duration::from_secs_f64(seconds));
    metered.sample_count += 1;
    metered.state = MeterState::Running;
    metered.info = Some(MeterInfo {
        name: "simulated".into(),
        provenance: Provenance::Measured,
        description: String::new(),
    });
}

/// Plays `seconds` of frames of `delta` seconds on a device that draws what `device` says of the map's
/// power, with a reading each quarter of a second or frame; seconds above `limit`.
fn play(
    app: &mut App,
    camera: Entity,
    (seconds, delta): (f64, f64),
    limit: f64,
    device: impl Fn(f64) -> f64,
) -> f64 {
    frame(app, delta);
    let (mut sum, mut length, mut over) = (0.0, 0.0, 0.0);
    for _ in 0..(seconds / delta).round() as usize {
        app.update();
        let watts = device(predicted(app, camera).map_or(4.0, |watts| watts.0));
        (sum, length) = (sum + watts * delta, length + delta);
        over += if watts > limit * 1.02 { delta } else { 0.0 };
        if length >= 0.25 {
            read(app, sum / length, length);
            (sum, length) = (0.0, 0.0);
        }
    }
    over
}

fn feedback(app: &App) -> PowerFeedback {
    *app.world().resource::<PowerFeedback>()
}

#[test]
fn a_headroom_that_is_missing_is_the_last_one_and_then_none() {
    let (mut app, camera) = steps(Budget::default().with_headroom(0.5));
    run(&mut app, 60);
    assert_eq!(drawn(&app, camera), 14.0, "never known: no limit");
    // A number once a second, as Android gives it.
    for number in 0..600 {
        let share = if number % 60 == 0 { 0.1 } else { f64::NAN };
        app.world_mut().resource_mut::<ThermalHeadroom>().share = Some(share);
        app.update();
        assert!(number < 120 || drawn(&app, camera) <= 6.0, "frame {number}");
    }
    let before = drawn(&app, camera);
    for (missing, seconds) in [(Some(f64::NAN), 8), (None, 1)] {
        app.world_mut().resource_mut::<ThermalHeadroom>().share = missing;
        run(&mut app, 60 * seconds);
        assert_eq!(drawn(&app, camera), before, "held");
    }
    run(&mut app, 60 * 4);
    assert_eq!(drawn(&app, camera), 4.0, "too old");
    app.world_mut().resource_mut::<ThermalHeadroom>().share = Some(1.0);
    run(&mut app, 60 * 4);
    assert_eq!(drawn(&app, camera), 14.0, "back");
}

fn battery(app: &mut App, energy: Option<f64>) {
    let energy = energy.map(Joules);
    let power = energy.map(|_| Watts(10.0));
    app.insert_resource(BatteryLevel { energy, power });
}

/// An app that has 6 W for an hour.
fn on_battery() -> (App, Entity) {
    let (mut app, camera) = steps(Budget::default().with_battery_until(3600 * SECOND));
    for _ in 0..6 {
        battery(&mut app, Some(6.0 * 3600.0));
        run(&mut app, 60);
    }
    (app, camera)
}

#[test]
fn a_battery_that_is_not_read_goes_on_giving_its_power() {
    let (mut app, camera) = on_battery();
    let before = drawn(&app, camera);
    assert!(before < 8.0, "{before}");
    for unknown in [f64::NAN, -1.0, f64::INFINITY] {
        battery(&mut app, Some(unknown));
        run(&mut app, 60 * 10);
        assert!(drawn(&app, camera) <= before, "{unknown}");
    }
    // A charger lifts the limit, a gap of some seconds does not.
    battery(&mut app, None);
    run(&mut app, 60 * 5);
    assert!(drawn(&app, camera) <= before);
    run(&mut app, 60 * 10);
    assert_eq!(drawn(&app, camera), 14.0);
}

#[test]
fn a_battery_budget_is_right_after_frames_without_a_prediction() {
    // Once with the camera active from the start, once after a minute in which it is not.
    let of = |loading: usize| {
        let (mut app, camera) = steps(Budget::default().with_battery_until(3600 * SECOND));
        let is_active = |app: &mut App, is_active: bool| {
            let camera_on = Camera { is_active, ..Default::default() };
            app.world_mut().entity_mut(camera).insert(camera_on);
        };
        is_active(&mut app, false);
        for _ in 0..loading {
            app.insert_resource(BatteryLevel {
                energy: Some(Joules(9.0 * 3600.0)),
                power: Some(Watts(5.0)),
            });
            run(&mut app, 60);
        }
        is_active(&mut app, true);
        for _ in 0..60 {
            // The rest of the machine takes 2 W.
            let power = predicted(&app, camera).map_or(4.0, |watts| watts.0) + 2.0;
            app.insert_resource(BatteryLevel {
                energy: Some(Joules(9.0 * 3600.0)),
                power: Some(Watts(power)),
            });
            run(&mut app, 60);
        }
        drawn(&app, camera)
    };
    let (at_once, after_loading) = (of(0), of(60));
    assert!((6.0..8.0).contains(&at_once), "{at_once}");
    assert!((after_loading - at_once).abs() < 0.6, "{after_loading} and {at_once}");
}

#[test]
fn a_nights_fall_of_the_charge_is_no_power() {
    let (mut app, camera) = steps(Budget::default().with_battery_until(10 * 3600 * SECOND));
    let mut energy = 10.0 * 36_000.0;
    let mut play = |app: &mut App, seconds: usize| {
        for _ in 0..seconds {
            energy -= predicted(app, camera).map_or(4.0, |watts| watts.0) + 2.0;
            let energy = Some(Joules(energy));
            app.insert_resource(BatteryLevel { energy, power: None });
            run(app, 60);
        }
        drawn(app, camera)
    };
    let before = play(&mut app, 120);
    // 3 Wh are gone while the machine slept, of 100.
    let (mut app, energy_left) = (app, -10_800.0);
    let mut battery = app.world_mut().resource_mut::<BatteryLevel>();
    let asleep = battery.energy.map(|energy| Joules(energy.0 + energy_left));
    battery.energy = asleep;
    run(&mut app, 60);
    energy += energy_left;
    for _ in 0..60 {
        energy -= drawn(&app, camera) + 2.0;
        let energy = Some(Joules(energy));
        app.insert_resource(BatteryLevel { energy, power: None });
        run(&mut app, 60);
        assert!((drawn(&app, camera) - before).abs() < 1.2, "{} and {before}", drawn(&app, camera));
    }
}

#[test]
fn a_frame_time_is_kept_on_a_device_that_takes_half_a_second() {
    for (best, is_told) in [(0.2, false), (0.5, false), (0.5, true), (3.0, false), (6.0, true)] {
        let budget = Budget::default().with_frame_time(Duration::from_millis(50));
        let (mut app, camera) = steps(budget);
        let (mut seconds, mut passed) = (best, 0.0);
        while passed < 60.0 {
            frame(&mut app, seconds);
            if is_told {
                app.world_mut().resource_mut::<FrameTime>().work =
                    Some(Duration::from_secs_f64(seconds));
            }
            app.update();
            passed += seconds;
            seconds = 0.04 + (best - 0.04) * (drawn(&app, camera) - 4.0) / 10.0;
        }
        let found = selection(&app, camera);
        assert!((0.035..0.056).contains(&seconds), "{best}: {seconds} s");
        assert_eq!(found.binding, Some(Limit::FrameTime), "{best}");
    }
}

#[test]
fn pauses_are_no_frame_time() {
    let budget = Budget::default().with_frame_time(Duration::from_millis(20));
    let (mut app, camera) = steps(budget);
    run(&mut app, 300);
    for pause in [0.3, 1.0, 3.9, 5.0, 60.0] {
        frame(&mut app, pause);
        run(&mut app, 2);
        frame(&mut app, 1.0 / 60.0);
        run(&mut app, 60);
        assert_eq!(drawn(&app, camera), 14.0, "{pause} s");
    }
}

#[test]
fn the_wait_of_a_frame_rate_limit_is_no_work() {
    let budget = Budget::default().with_frame_time(Duration::from_millis(16));
    let (mut app, camera) = steps(budget);
    // 60 frames a second, of which 8 ms are work.
    app.insert_resource(crate::pacing::FrameWait(Duration::from_secs_f64(1.0 / 60.0 - 0.008)));
    run(&mut app, 300);
    assert_eq!(drawn(&app, camera), 14.0);
    app.insert_resource(crate::pacing::FrameWait(Duration::ZERO));
    run(&mut app, 300);
    assert!(drawn(&app, camera) < 10.0, "work of 16.7 ms");
}

fn resize(app: &mut App, camera: Entity, width: u32, height: u32) {
    use bevy::camera::RenderTargetInfo;
    let mut camera = app.world_mut().get_mut::<Camera>(camera).expect("a camera");
    let physical_size = UVec2::new(width, height);
    camera.computed.target_info = Some(RenderTargetInfo { physical_size, scale_factor: 1.0 });
}

#[test]
fn idle_minimised_and_reactive_apps_teach_nothing() {
    for (name, delta) in [("minimised", 1.0 / 60.0), ("reactive", 5.0), ("reactive", 1.0)] {
        let limit = 9.0;
        let (mut app, camera) = steps(Budget::default().with_peak(Watts(limit)));
        app.world_mut().entity_mut(camera).insert(Camera::default());
        let [width, height] = testing::steps().capture.size;
        resize(&mut app, camera, width, height);
        play(&mut app, camera, (30.0, 1.0 / 60.0), limit, |watts| watts);
        let before = feedback(&app).correction;
        if name == "minimised" {
            resize(&mut app, camera, 0, 0);
        }
        // The device is idle.
        play(&mut app, camera, (60.0, delta), limit, |_| 3.0);
        let fit = app.world().get::<MapFit>(camera).expect("a fit");
        assert!(!fit.has(Misfit::Size), "{name}: {fit:?}");
        resize(&mut app, camera, width, height);
        let over = play(&mut app, camera, (10.0, 1.0 / 60.0), limit, |watts| watts);
        let after = feedback(&app).correction;
        assert!(over <= 0.55, "{name} {delta}: {over} s over");
        let watts = |it: crate::control::PowerCorrection| it.corrected(Watts(limit)).0;
        assert!((watts(after) / watts(before) - 1.0).abs() < 0.03, "{name}: {before:?}, {after:?}");
    }
}

#[test]
fn without_a_limit_of_the_frame_rate_a_peak_holds_in_watts() {
    for (limit, expected) in [(70.0, 14.0), (50.0, 4.0)] {
        let (mut app, camera) = steps(Budget::default().with_peak(Watts(limit)));
        let (mut passed, mut since, mut changes, mut target) = (0.0, 0.0, 0, None);
        while passed < 40.0 {
            app.update();
            let now = selection(&app, camera).target;
            changes += usize::from(passed > 10.0 && target.is_some_and(|before| before != now));
            target = Some(now);
            // Always 60 W: cheaper settings give more frames.
            let seconds = drawn(&app, camera) / 60.0 / 60.0;
            frame(&mut app, seconds);
            (passed, since) = (passed + seconds, since + seconds);
            if since >= 0.25 {
                read(&mut app, 60.0, since);
                since = 0.0;
            }
        }
        let found = selection(&app, camera);
        assert_eq!((drawn(&app, camera), changes), (expected, 0), "{limit} W: {found:?}");
        let is_met = found.status == ControlStatus::Active(Outcome::Met);
        assert_eq!(is_met, limit > 60.0, "{found:?}");
    }
}

#[test]
fn a_knob_that_is_pinned_stays_and_the_others_keep_the_budget() {
    let (mut app, camera) = steps(Budget::power(Watts(7.0)));
    run(&mut app, 120);
    let free = selection(&app, camera).target;
    // A menu writes one knob's level.
    let mut knobs = app.world_mut().get_mut::<KnobSettings>(camera).expect("settings");
    let highest = knobs.space.knobs()[1].levels.len() - 1;
    knobs.settings = knobs.settings.with_level(1, highest);
    for _ in 0..300 {
        app.update();
        assert_eq!(applied(&app, camera).level(1), highest);
    }
    assert!(applied(&app, camera).level(0) < free.level(0), "the other gives way");
    let bounds = |app: &mut App, change: &dyn Fn(&mut KnobBounds)| {
        change(&mut app.world_mut().get_mut::<KnobBounds>(camera).expect("bounds"));
        run(app, 300);
    };
    let names: Vec<String> =
        testing::steps().knobs.knobs().iter().map(|knob| knob.name.clone()).collect();
    // At a budget that the bounds leave no settings for.
    set_budget(&mut app, camera, Budget::power(Watts(4.0)));
    bounds(&mut app, &|_| {});
    let cannot = ControlStatus::Active(Outcome::PowerCannotBeMet);
    assert_eq!(selection(&app, camera).status, cannot);
    bounds(&mut app, &|bounds| bounds.clear());
    assert_eq!(selection(&app, camera).status, ControlStatus::Active(Outcome::Met));
    // Without a limit, what keeps settings from being better is the bound.
    set_budget(&mut app, camera, Budget::default());
    bounds(&mut app, &|bounds| {
        bounds.at_most(&names[0], 3);
    });
    let found = selection(&app, camera);
    assert_eq!((found.binding, found.applied.level(0)), (Some(Limit::KnobBounds), 3));
    assert_eq!(found.applied.level(1), highest);
    bounds(&mut app, &|bounds| {
        bounds.release(&names[0]);
    });
    assert_eq!((drawn(&app, camera), selection(&app, camera).binding), (14.0, None));
}

//! A camera under the controller, with a hand-written map.

use std::time::Duration;

use bevy::asset::Assets;
use bevy::math::Vec3;
use bevy_frugal_gi::control::{
    Budget, ControlSettings, ControlStatus, OffReason, Outcome, PowerController, Selection,
};
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::{Knob, KnobSettings, KnobSpace};
use bevy_frugal_gi::units::Watts;
use frugal::stage::Stage;
use frugal_tests::{map, set};

tests!(
    a_budget_changes_the_rendered_settings,
    invalid_budgets_change_nothing,
    a_map_of_unknown_knobs_is_refused,
    settings_move_smoothly
);

const KNOBS: [&str; 2] = ["gi_vpl_count", "gi_pixel_fraction"];

fn stage() -> Stage {
    let mut stage = set::open(&set::scene("two_rooms"), set::options(32, 18));
    set::look(&mut stage, Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6));
    set::apply(&mut stage, "min,gi_vpl_count=64");
    stage.frame();
    stage
}

/// Puts the camera under the controller.
fn control(stage: &mut Stage, knobs: KnobSpace, budget: Budget, seconds: f64) {
    let camera = set::camera(stage);
    let world = stage.world_mut();
    world.insert_resource(ControlSettings {
        transition: Duration::from_secs_f64(seconds),
        dwell: Duration::ZERO,
        ..Default::default()
    });
    let map = world.resource_mut::<Assets<FrontierMap>>().add(map::one_cube(knobs));
    world.entity_mut(camera).insert((PowerController(map), budget));
    (0..2).for_each(|_| stage.frame());
}

fn budget(stage: &mut Stage, budget: Budget) {
    let camera = set::camera(stage);
    stage.world_mut().entity_mut(camera).insert(budget);
    // The controller may write settings after they were applied: then they take one more frame.
    (0..3).for_each(|_| stage.frame());
}

fn selection(stage: &mut Stage) -> Selection {
    let camera = set::camera(stage);
    *stage.world_mut().get::<Selection>(camera).expect("a controlled camera")
}

fn gi(stage: &mut Stage) -> FrugalGi {
    let camera = set::camera(stage);
    stage.world_mut().get::<FrugalGi>(camera).expect("a GI camera").clone()
}

fn space(stage: &Stage) -> KnobSpace {
    stage.space().subset(KNOBS).expect("built-in knobs")
}

fn a_budget_changes_the_rendered_settings() {
    let mut stage = stage();
    let knobs = space(&stage);
    control(&mut stage, knobs, Budget::power(Watts(2.5)), 0.0);
    for (limit, count, outcome, power) in [
        (2.5, 512, Outcome::Met, 2.0),
        (9.0, 4096, Outcome::Met, 4.0),
        (1.0, 0, Outcome::Met, 1.0),
        (f64::INFINITY, 4096, Outcome::Met, 4.0),
        (0.5, 0, Outcome::PowerCannotBeMet, 1.0),
        (0.0, 0, Outcome::PowerCannotBeMet, 1.0),
    ] {
        budget(&mut stage, Budget::power(Watts(limit)));
        let found = selection(&mut stage);
        assert_eq!(found.status, ControlStatus::Active(outcome), "{limit} W");
        assert_eq!(found.predicted.map(|cost| cost.power.0), Some(power), "{limit} W");
        assert_eq!(gi(&mut stage).vpl_count, count, "{limit} W");
        // Light that is switched off fades for 0.8 s.
        (0..25).for_each(|_| stage.frame());
        let gathered = set::gathered(&stage);
        assert_eq!(gathered.pairs > 0, count > 0, "{limit} W: {gathered:?}");
    }
    budget(&mut stage, Budget::error(0.1));
    assert_eq!(
        (selection(&mut stage).status, gi(&mut stage).vpl_count),
        (ControlStatus::Active(Outcome::Met), 512)
    );
}

fn invalid_budgets_change_nothing() {
    let mut stage = stage();
    let knobs = space(&stage);
    control(&mut stage, knobs, Budget::power(Watts(2.5)), 0.0);
    for limit in [f64::NAN, -1.0, f64::NEG_INFINITY] {
        for invalid in
            [Budget::power(Watts(limit)), Budget::error(limit), Budget::both(Watts(1.0), limit)]
        {
            budget(&mut stage, invalid);
            let found = selection(&mut stage);
            assert_eq!(found.status, ControlStatus::Off(OffReason::InvalidBudget), "{invalid:?}");
            assert_eq!((found.predicted, gi(&mut stage).vpl_count), (None, 512), "{invalid:?}");
        }
    }
    budget(&mut stage, Budget::power(Watts(4.0)));
    assert_eq!(
        (selection(&mut stage).status, gi(&mut stage).vpl_count),
        (ControlStatus::Active(Outcome::Met), 4096),
        "active again"
    );
}

fn a_map_of_unknown_knobs_is_refused() {
    let mut stage = stage();
    let before = gi(&mut stage);
    let knobs = KnobSpace::new(vec![
        Knob::new("gi_vpl_count", [0.0, 32.0]),
        Knob::new("sharpness", [0.0, 1.0]),
    ])
    .expect("a space");
    control(&mut stage, knobs, Budget::default(), 0.0);
    assert_eq!(selection(&mut stage).status, ControlStatus::Off(OffReason::UnknownKnobs));
    assert_eq!(gi(&mut stage), before);
}

fn settings_move_smoothly() {
    let mut stage = stage();
    let knobs = space(&stage);
    control(&mut stage, knobs, Budget::power(Watts(2.5)), 0.0);
    // The stage's clock steps by 1/30 s: a second is 30 frames.
    stage.world_mut().insert_resource(ControlSettings {
        transition: Duration::from_secs(1),
        ..Default::default()
    });
    let camera = set::camera(&mut stage);
    let mut levels = |watts: f64| {
        stage.world_mut().entity_mut(camera).insert(Budget::power(Watts(watts)));
        let level = |_| {
            stage.frame();
            let settings = stage.world_mut().get::<KnobSettings>(camera).expect("settings");
            settings.settings.level(0)
        };
        (0..40).map(level).collect::<Vec<_>>()
    };
    let rise = levels(4.0);
    assert!(
        rise.is_sorted() && rise.windows(2).all(|pair| pair[1] - pair[0] <= 1),
        "no level is skipped: {rise:?}"
    );
    assert!(rise[0] <= 5 && rise[10] < 7 && rise[39] == 7, "{rise:?}");
    // GI goes at once, half-way: its light fades.
    let off = levels(1.0);
    assert!(off.iter().all(|level| [0, 7].contains(level)), "{off:?}");
    assert!(off[10] == 7 && off[20] == 0, "{off:?}");
}

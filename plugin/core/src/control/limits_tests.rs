//! Tests of the envelope.

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::control::choose::choose;
use crate::control::observed::Exchange;
use crate::control::rate::Rate;
use crate::control::{Choice, Outcome};
use crate::frontier::{CostPoint, Frontier};
use crate::testing;
use crate::units::Joules;

fn all_known() -> Observed {
    Observed {
        frames_per_second: Some(60.0),
        // 1 ms a watt, beside 2 ms.
        frame_time: Some(Exchange {
            correction: PowerCorrection { gain: 1.0, offset: Watts(2.0) },
            scale: 1000.0,
        }),
        now_seconds: 100.0,
        battery: Some(Joules(36_000.0)),
        // The machine draws 3 W beside the cameras.
        battery_power: Some(Exchange {
            correction: PowerCorrection { gain: 1.0, offset: Watts(3.0) },
            scale: 1.0,
        }),
        headroom: Some(0.15),
        correction: PowerCorrection::default(),
        cameras: 1,
        range: Some((Watts(4.0), Watts(14.0))),
    }
}

/// The choice in a still view.
fn choose_still(frontier: &Frontier, limits: &Limits) -> Option<Choice> {
    let most = CostPoint::new(f64::INFINITY, f64::INFINITY);
    let rate = Rate { watts_per_error: f64::INFINITY, most, is_by_error: false };
    choose(frontier, limits, &rate, false)
}

fn limits_of(budget: &Budget, observed: &Observed) -> Limits {
    resolve(budget, observed).expect("valid limits")
}

/// The power limit, rounded, and what it comes from.
fn resolved(budget: Budget, observed: &Observed) -> Option<(f64, Limit)> {
    let limits = limits_of(&budget, observed);
    Some(((limits.power?.0 * 1e6).round() / 1e6, limits.power_by?))
}

#[test]
fn every_currency_becomes_watts_and_the_tightest_holds() {
    let (none, known) = (Budget::default(), all_known());
    let energy = none.with_energy_per_frame(Joules(0.15));
    let time = none.with_frame_time(Duration::from_millis(10));
    let battery = none.with_battery_until(Duration::from_secs(3700));
    let headroom = none.with_headroom(0.3);
    assert_eq!(resolved(none, &known), None);
    assert_eq!(resolved(energy, &known), Some((9.0, Limit::EnergyPerFrame)));
    let peak = |budget: Budget| {
        let limits = limits_of(&budget, &known);
        Some(((limits.peak?.0 * 1e6).round() / 1e6, limits.peak_by?))
    };
    assert_eq!((resolved(time, &known), peak(time)), (None, Some((8.0, Limit::FrameTime))));
    assert_eq!(peak(time.with_peak(Watts(7.0))), Some((7.0, Limit::Peak)));
    assert_eq!(resolved(battery, &known), Some((7.0, Limit::Battery)));
    assert_eq!(resolved(headroom, &known), Some((9.0, Limit::Headroom)));
    let together = Budget { headroom: Some(0.3), ..battery }
        .with_energy_per_frame(Joules(0.15))
        .with_frame_time(Duration::from_millis(10));
    assert_eq!(resolved(together, &known), Some((7.0, Limit::Battery)));
    let tighter = Budget { power: Some(Watts(6.5)), error: Some(0.02), ..together };
    assert_eq!(resolved(tighter, &known), Some((6.5, Limit::Power)));
    assert_eq!(limits_of(&tighter, &known).error, Some(0.02));
}

#[test]
fn watts_of_the_app_are_shared_by_its_cameras_and_corrected() {
    let correction = PowerCorrection { gain: 2.0, offset: Watts(1.0) };
    let known = Observed { cameras: 2, correction, ..all_known() };
    let none = Budget::default();
    let of = |budget| resolved(budget, &known).map(|(watts, _)| watts);
    let time = limits_of(&none.with_frame_time(Duration::from_millis(10)), &known);
    assert_eq!(time.peak, Some(Watts(8.5)), "(2 × 8 + 1) / 2");
    assert_eq!(of(none.with_energy_per_frame(Joules(0.15))), Some(4.5));
    assert_eq!(of(Budget::power(Watts(5.0))), Some(5.0), "a camera's own");
}

#[test]
fn what_is_not_known_limits_nothing() {
    let budget = Budget::error(0.02)
        .with_energy_per_frame(Joules(0.0))
        .with_frame_time(Duration::ZERO)
        .with_battery_until(Duration::from_secs(10))
        .with_headroom(1.0);
    assert_eq!(resolved(budget, &Observed::default()), None);
    assert_eq!(limits_of(&budget, &Observed::default()).peak, None);
    // The time is over, the promise kept.
    let battery = Budget::default().with_battery_until(Duration::from_secs(100));
    assert_eq!(resolved(battery, &all_known()), None);
    let cool = Observed { headroom: Some(0.3), ..all_known() };
    assert_eq!(resolved(Budget::default().with_headroom(0.3), &cool), None);
    assert_eq!(resolved(Budget::default().with_headroom(0.0), &all_known()), None);
}

#[test]
fn what_cannot_be_met_is_the_cheapest_and_names_the_limit() {
    let frontier = testing::frontier(1.0);
    let empty = Observed { battery: Some(Joules(0.0)), ..all_known() };
    let hot =
        Observed { headroom: Some(0.0), range: Some((Watts(1.0), Watts(4.0))), ..all_known() };
    let none = Budget::default();
    for (budget, observed, limit, outcome) in [
        (
            none.with_frame_time(Duration::ZERO),
            all_known(),
            Limit::FrameTime,
            Outcome::PowerCannotBeMet,
        ),
        (
            none.with_battery_until(Duration::from_secs(900)),
            empty,
            Limit::Battery,
            Outcome::PowerCannotBeMet,
        ),
        (
            none.with_energy_per_frame(Joules(0.0)),
            all_known(),
            Limit::EnergyPerFrame,
            Outcome::PowerCannotBeMet,
        ),
        (none.with_headroom(0.3), hot, Limit::Headroom, Outcome::Met),
    ] {
        let limits = limits_of(&budget, &observed);
        let choice = choose_still(&frontier, &limits).expect("a choice");
        assert_eq!((choice.cost.power, choice.outcome), (Watts(1.0), outcome), "{limit:?}");
        assert_eq!(choice.binding, Some(limit));
    }
}

#[test]
fn the_binding_limit_is_the_one_without_which_settings_were_better() {
    // Points at 1 W / 0.2, 2 W / 0.05 and 4 W / 0.
    let frontier = testing::frontier(1.0);
    let binds = |budget: Budget| {
        let limits = limits_of(&budget, &all_known());
        choose_still(&frontier, &limits).expect("a choice").binding
    };
    assert_eq!(binds(Budget::default()), None);
    assert_eq!(binds(Budget::power(Watts(2.5))), Some(Limit::Power));
    assert_eq!(binds(Budget::power(Watts(9.0))), None, "the best settings are within it");
    assert_eq!(binds(Budget::error(0.1)), Some(Limit::Error));
    assert_eq!(binds(Budget::error(f64::INFINITY)), Some(Limit::Error));
    assert_eq!(binds(Budget::both(Watts(9.0), 0.1)), Some(Limit::Error));
    assert_eq!(binds(Budget::both(Watts(2.5), 0.01)), Some(Limit::Power));
}

proptest! {
    #[test]
    fn a_looser_limit_or_more_room_never_lowers_the_power(
        limits in prop::array::uniform4(0.0..1.0_f64),
        looser in prop::array::uniform4(0.0..1.0_f64),
        gain in 0.1..10.0_f64,
        offset in -20.0..20.0_f64,
    ) {
        let with = |[energy, time, left, headroom]: [f64; 4]| {
            let budget = Budget::default()
                .with_energy_per_frame(Joules(energy))
                .with_frame_time(Duration::from_secs_f64(0.05 * time))
                .with_battery_until(Duration::from_secs(7300))
                .with_headroom(0.5);
            let correction = PowerCorrection { gain, offset: Watts(offset) };
            let exchange = Some(Exchange { correction, scale: 100.0 });
            let observed = Observed {
                battery: Some(Joules(1e5 * left)),
                headroom: Some(headroom),
                frame_time: exchange,
                battery_power: exchange,
                ..all_known()
            };
            let limits = limits_of(&budget, &observed);
            [limits.power, limits.peak].map(|limit| limit.map_or(f64::INFINITY, |watts| watts.0))
        };
        let more = [0, 1, 2, 3].map(|i| limits[i] + looser[i]);
        let ([power, peak], [less, lower]) = (with(more), with(limits));
        prop_assert!(power >= less && peak >= lower);
    }

    #[test]
    fn any_numbers_give_a_limit_of_0_or_more_or_none(
        numbers in prop::array::uniform8(prop::num::f64::ANY),
        cameras in 0_usize..4,
    ) {
        let [energy, headroom, rate, now, left, share, gain, offset] = numbers;
        let correction = PowerCorrection { gain: gain.abs(), offset: Watts(offset) };
        let exchange = Some(Exchange { correction, scale: rate });
        let budget = Budget::default()
            .with_energy_per_frame(Joules(energy))
            .with_frame_time(Duration::from_secs(1))
            .with_battery_until(Duration::MAX)
            .with_headroom(headroom);
        let observed = Observed {
            frames_per_second: Some(rate),
            frame_time: exchange,
            now_seconds: now,
            battery: Some(Joules(left)),
            battery_power: exchange,
            headroom: Some(share),
            correction,
            cameras,
            range: Some((Watts(gain), Watts(offset))),
        };
        let Ok(Limits { power, peak, .. }) = resolve(&budget, &observed) else { return Ok(()) };
        for limit in [power, peak].into_iter().flatten() {
            prop_assert!(limit.0 >= 0.0 && limit.0.is_finite(), "{:?}", limit);
        }
    }
}

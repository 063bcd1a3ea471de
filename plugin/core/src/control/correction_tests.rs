//! The controller with feedback on a simulated device.

use proptest::prelude::*;

use super::*;
use crate::control::{Budget, CameraController, ControlSettings, Inputs};
use crate::frontier::FrontierMap;
use crate::knobs::KnobLevels;
use crate::testing;
use crate::testing::{SimulatedDevice, SimulatedMeter};

const FRAME: f64 = 1.0 / 60.0;

/// A controlled app on a simulated device.
struct Loop {
    map: FrontierMap,
    controller: CameraController,
    model: PowerModel,
    device: SimulatedDevice,
    meter: SimulatedMeter,
    budget: Watts,
    current: Option<KnobLevels>,
    switches: usize,
    /// Power of every frame.
    powers: Vec<f64>,
}

impl Loop {
    fn new(device: SimulatedDevice, meter: SimulatedMeter, budget: f64) -> Self {
        Self {
            map: testing::steps(),
            controller: CameraController::default(),
            model: PowerModel::default(),
            device,
            meter,
            budget: Watts(budget),
            current: None,
            switches: 0,
            powers: Vec::new(),
        }
    }

    fn run(&mut self, seconds: f64) -> &mut Self {
        for _ in 0..(seconds / FRAME).round() as usize {
            let inputs = Inputs {
                store: &self.map,
                view: testing::view(),
                budget: Budget::default().with_peak(self.budget),
                delta_seconds: FRAME,
                current: self.current,
                correction: self.model.correction(),
                mean_correction: self.model.mean_correction(),
                settings: ControlSettings::default(),
                errors: crate::control::ErrorFeedback::default(),
            };
            let found = self.controller.step(&inputs).expect("a decision");
            self.switches += usize::from(self.current.is_some_and(|old| old != found.applied));
            self.current = Some(found.applied);
            let power = self.device.step(found.uncorrected, FRAME);
            self.powers.push(power.0);
            self.model.predict(found.uncorrected, FRAME);
            if let Some((watts, seconds)) = self.meter.step(power, FRAME) {
                self.model.read(watts, seconds);
            }
        }
        self
    }

    /// Seconds from frame `from` to the last window of a quarter of a second that exceeds the
    /// budget by more than 2 %.
    fn seconds_over(&self, from: usize) -> f64 {
        let window = 15;
        let over =
            |powers: &&[f64]| powers.iter().sum::<f64>() / window as f64 > self.budget.0 * 1.02;
        let windows: Vec<&[f64]> = self.powers[from..].chunks_exact(window).collect();
        windows.iter().rposition(over).map_or(0.0, |last| (last + 1) as f64 * window as f64 * FRAME)
    }

    fn frames(&self) -> usize {
        self.powers.len()
    }

    /// Mean power of the last `seconds` as a share of the budget.
    fn used(&self, seconds: f64) -> f64 {
        let frames = (seconds / FRAME) as usize;
        let last = &self.powers[self.powers.len() - frames..];
        last.iter().sum::<f64>() / frames as f64 / self.budget.0
    }
}

fn noisy(interval: f64) -> SimulatedMeter {
    SimulatedMeter::new(interval).with_noise(0.02).with_latency(0.05)
}

#[test]
fn a_hungrier_device_is_within_its_budget_in_three_seconds() {
    for (gain, idle, interval, budget) in [
        (1.4, 0.0, 0.25, 11.0),
        (1.4, 0.0, 1.0, 11.0),
        (1.4, 2.0, 0.25, 11.0),
        (1.0, 5.0, 0.25, 11.0),
        (0.6, 0.0, 0.25, 6.0),
    ] {
        let device = SimulatedDevice { gain, idle: Watts(idle), ..Default::default() };
        let mut app = Loop::new(device, noisy(interval), budget);
        app.run(20.0);
        let seconds = app.seconds_over(0);
        let (before, mid) = (app.switches, app.frames());
        app.run(60.0);
        let rate = (app.switches - before) as f64 / 60.0;
        let (late, used) = (app.seconds_over(mid), app.used(50.0));
        println!(
            "    {gain} x the map + {idle} W, readings of {interval} s: {seconds:.2} s over, then {rate:.2} switches/s, {:.1} % of the budget used",
            100.0 * used
        );
        assert!(seconds <= 3.0, "{seconds} s");
        assert_eq!(late, 0.0, "over the budget again");
        assert!(rate <= 0.25, "{rate} switches a second");
        assert!(used > 0.9 && used <= 1.01, "{used}");
    }
}

#[test]
fn without_feedback_the_hungrier_device_stays_over_its_budget() {
    let device = SimulatedDevice { gain: 1.4, ..Default::default() };
    let mut app = Loop::new(device, noisy(0.25), 11.0);
    app.meter.is_lost = true;
    app.run(20.0);
    assert!(app.used(10.0) > 1.3 && app.model.readings() == 0);
    assert_eq!(app.model.correction(), PowerCorrection::default());
}

#[test]
fn a_device_that_changes_half_way_is_within_its_budget_in_three_seconds() {
    let mut app = Loop::new(SimulatedDevice::default(), noisy(0.25), 9.0);
    app.run(20.0);
    let (mid, before) = (app.frames(), app.switches);
    // A hot board leaks: the same frames take more.
    app.device.gain = 1.5;
    app.run(30.0);
    let (hungrier, again) = (app.seconds_over(mid), app.frames());
    // Throttled: a lower clock takes less, and settings may rise.
    app.device.throttles_at = 0.0;
    app.run(30.0);
    let (throttled, used) = (app.seconds_over(again), app.used(20.0));
    println!(
        "    hungrier half way: {hungrier:.2} s over; throttled: {throttled:.2} s over, then {:.1} % of the budget used; {} switches in 60 s",
        100.0 * used,
        app.switches - before
    );
    assert!(app.device.is_throttled);
    assert!(hungrier > 0.0 && hungrier <= 3.0 && throttled <= 3.0);
    assert!(used > 0.9, "{used}");
    assert!(app.switches - before <= 60, "{} switches", app.switches - before);
}

#[test]
fn a_governor_with_hysteresis_causes_no_limit_cycle() {
    // Full power would throttle it; the budget keeps it just below.
    let device =
        SimulatedDevice { gain: 1.2, thermal_mass: 4.0, throttles_at: 9.5, ..Default::default() };
    let mut app = Loop::new(device, noisy(0.25), 10.0);
    app.run(120.0);
    let rate = app.switches as f64 / 120.0;
    println!("    beside a throttling governor: {rate:.2} switches/s");
    assert!(rate <= 1.0, "{rate}");
}

#[test]
fn views_that_the_map_prices_wrong_leave_the_mean_within_the_budget() {
    for (wrong, seconds) in [(0.08, 1.5), (0.08, 3.0), (0.15, 3.0), (0.15, 8.0)] {
        let mut app = Loop::new(SimulatedDevice::default(), noisy(1.0), 9.0);
        for view in 0..(120.0 / seconds) as u32 {
            app.device.gain = if view.is_multiple_of(2) { 1.0 + wrong } else { 1.0 - wrong };
            app.run(seconds);
        }
        let used = app.used(90.0);
        println!(
            "    {:.0} % up and down every {seconds} s: {:.1} % of the budget used",
            100.0 * wrong,
            100.0 * used
        );
        assert!((0.93..=1.005).contains(&used), "{used}");
    }
}

#[test]
fn a_lost_meter_keeps_its_last_correction() {
    let device = SimulatedDevice { gain: 1.4, ..Default::default() };
    let mut app = Loop::new(device, noisy(0.25), 11.0);
    app.run(20.0);
    app.meter.is_lost = true;
    let (mid, correction) = (app.frames(), app.model.correction());
    app.run(20.0);
    assert_eq!((app.seconds_over(mid), app.model.correction()), (0.0, correction));
    // Another budget holds, too.
    app.budget = Watts(8.0);
    let mid = app.frames();
    app.run(20.0);
    let seconds = app.seconds_over(mid);
    println!("    another budget without the meter: {seconds:.2} s over");
    assert!(seconds <= 3.0, "{seconds}");
}

#[test]
fn single_bad_readings_change_nothing() {
    let mut app = Loop::new(SimulatedDevice::default(), noisy(0.25), 9.0);
    app.run(20.0);
    let before = app.model.correction();
    let at = |correction: PowerCorrection| correction.corrected(Watts(8.0)).0;
    for lie in [90.0, 0.0, 1e300, f64::NAN, f64::INFINITY, -5.0] {
        app.model.read(Watts(lie), 0.25);
        app.run(1.0);
        let now = app.model.correction();
        assert!((at(now) / at(before) - 1.0).abs() < 0.08, "{lie}: {now:?}");
    }
    app.model.read(Watts(9.0), f64::NAN);
    app.model.read(Watts(9.0), 0.0);
    assert!(app.model.deviation().is_some_and(|deviation| deviation.0.is_finite()));
}

#[test]
fn a_correction_and_its_inverse_agree_at_the_extremes() {
    let correction = PowerCorrection { gain: 1.5, offset: Watts(-2.0) };
    for watts in [2.0, 7.0, 1e9] {
        let there = correction.uncorrected(correction.corrected(Watts(watts))).0;
        assert!((there / watts - 1.0).abs() < 1e-12, "{there}");
    }
    assert_eq!(correction.corrected(Watts(0.0)), Watts(0.0), "no power below 0 W");
    assert_eq!(correction.uncorrected(Watts(f64::INFINITY)), Watts(f64::INFINITY));
    assert!(correction.corrected(Watts(f64::NAN)).0.is_nan());
    assert_eq!(correction.shared_by(0), correction);
    assert_eq!(correction.shared_by(4).offset, Watts(-0.5));
}

proptest! {
    #[test]
    fn any_readings_leave_it_finite_and_bounded(
        readings in prop::collection::vec((prop::num::f64::ANY, prop::num::f64::ANY, prop::num::f64::ANY), 1..60),
    ) {
        let mut model = PowerModel::default();
        for (predicted, metered, seconds) in readings {
            model.predict(Watts(predicted.abs() % 1e4), 0.1);
            model.predict(Watts(predicted), seconds);
            model.read(Watts(metered), seconds);
            model.read(Watts(metered.abs() % 1e4), 0.1);
            let PowerCorrection { gain, offset } = model.correction();
            prop_assert!((0.1..=10.0).contains(&gain) && offset.0.is_finite(), "{:?}", model);
            prop_assert!(model.deviation().is_none_or(|deviation| deviation.0.is_finite()));
        }
    }
}

/// A device that cannot hold the map's frame rate at dear settings: beyond 6 W of the map's, frames
/// take longer, and power grows by a fifth as much.
fn saturating(predicted: f64) -> f64 {
    2.0 + predicted.min(6.0) + 0.2 * (predicted - 6.0).max(0.0)
}

#[test]
fn noise_at_one_operating_point_says_nothing_about_the_gain() {
    let mut model = PowerModel::default();
    let mut worst = (f64::INFINITY, 0.0_f64);
    // Views change predictions by a percent, and the device drifts by 4 % for reasons of its own.
    for reading in 0..2400_u32 {
        let phase = f64::from(reading) * 0.7;
        let predicted = Watts(5.0 + 0.05 * phase.sin());
        for _ in 0..15 {
            model.predict(predicted, FRAME);
        }
        let drift = 1.0 + 0.04 * (f64::from(reading) * 0.011).sin();
        model.read(Watts(saturating(predicted.0) * drift), 0.25);
        let gain = model.correction().gain;
        worst = (worst.0.min(gain), worst.1.max(gain));
        let there = model.correction().corrected(predicted).0;
        if reading > 40 {
            assert!((there / (saturating(predicted.0) * drift) - 1.0).abs() < 0.05, "{there}");
        }
    }
    println!("    gains from {:.2} to {:.2}", worst.0, worst.1);
    assert!(worst.0 > 0.7 && worst.1 < 1.6, "{worst:?}");
}

#[test]
fn two_points_that_disagree_do_not_make_a_steep_gain_so_that_no_setting_is_shut_out() {
    let mut model = PowerModel::default();
    let mut play = |predicted: f64, metered: f64, readings: u32| {
        for _ in 0..readings {
            for _ in 0..15 {
                model.predict(Watts(predicted), FRAME);
            }
            model.read(Watts(metered), 0.25);
        }
        model.correction().gain
    };
    // A straight line through both points has a gain of 2.5.
    play(4.0, 4.0, 20);
    let gains = [1, 2, 4, 12, 120].map(|readings| play(6.0, 9.0, readings));
    println!("    gains of {gains:.2?}");
    assert!(gains.iter().all(|gain| (1.0..1.6).contains(gain)), "{gains:?}");
    // Nor does a map that prices two neighbouring addresses 6 % apart where the device takes the same.
    let mut model = PowerModel::default();
    let mut play = |predicted: f64| {
        for _ in 0..20 {
            (0..6).for_each(|_| model.predict(Watts(predicted), FRAME));
            model.read(Watts(4.0), 0.1);
        }
        model.correction()
    };
    for predicted in [3.33, 3.15, 2.96, 3.33] {
        let found = play(predicted);
        assert!((0.8..1.6).contains(&found.gain), "{found:?}");
        let there = found.corrected(Watts(predicted)).0;
        assert!((3.9..=4.15).contains(&there), "{there}");
    }
}

#[test]
fn the_correction_of_a_mean_is_the_ratio_of_energies() {
    let mut model = PowerModel::default();
    assert_eq!(model.mean_correction(), PowerCorrection::default(), "nothing is read");
    // Views whose watts the map prices wrong by turns, on a device 1.4 times as hungry.
    for second in 0..600 {
        let predicted = if second % 4 < 2 { 4.0 } else { 12.0 };
        let off = if second % 4 < 2 { 1.3 } else { 0.9 };
        (0..30).for_each(|_| model.predict(Watts(predicted), 1.0 / 30.0));
        model.read(Watts(1.4 * off * predicted), 1.0);
    }
    let gain = model.mean_correction().gain;
    // Two seconds of 4 W and two of 12 W: the energies are 1.4 × (1.3 + 0.9 × 3) ÷ 4.
    assert!((gain / 1.4 - 1.0).abs() < 0.01, "{gain}");
    for odd in [f64::NAN, f64::INFINITY, -1.0] {
        model.read(Watts(odd), 1.0);
        model.read(Watts(5.0), odd);
    }
    assert!((model.mean_correction().gain / gain - 1.0).abs() < 0.02);
    let mut dark = PowerModel::default();
    (0..30).for_each(|_| dark.predict(Watts(0.0), 1.0 / 30.0));
    dark.read(Watts(5.0), 1.0);
    assert_eq!(dark.mean_correction(), PowerCorrection::default(), "no ratio");
}

#[test]
fn the_correction_of_a_mean_follows_a_device_that_changes() {
    for change in [1.4, 0.6] {
        let mut model = PowerModel::default();
        for second in 0..660 {
            let gain = if second < 600 { 1.0 } else { change };
            let predicted = if second % 10 < 5 { 4.0 } else { 8.0 };
            (0..30).for_each(|_| model.predict(Watts(predicted), 1.0 / 30.0));
            model.read(Watts(gain * predicted), 1.0);
        }
        let gain = model.mean_correction().gain;
        assert!((gain / change - 1.0).abs() < 0.05, "{gain} a minute after {change}");
    }
}

#[test]
fn a_meter_that_is_late_does_not_bend_the_correction_of_the_mean() {
    let watts = |second: usize| {
        let view = 4.0 + (78.233 * (second / 4) as f64).sin();
        // The first readings say that this is too much.
        if second < 30 { view } else { 0.6 * view }
    };
    let mut model = PowerModel::default();
    for second in 0..120 {
        (0..60).for_each(|_| model.predict(Watts(watts(second)), FRAME));
        if let Some(then) = second.checked_sub(30) {
            model.read(Watts(1.4 * watts(then)), 1.0);
        }
    }
    let gain = model.mean_correction().gain;
    assert!((gain / 1.4 - 1.0).abs() < 0.01, "{gain}");
    assert!(!model.has_left_map(), "{}", model.residual());
}

#[test]
fn a_first_reading_of_almost_nothing_is_not_believed() {
    let mut model = PowerModel::default();
    let mut read = |watts: f64, count: usize| {
        for _ in 0..count {
            (0..60).for_each(|_| model.predict(Watts(4.0), FRAME));
            model.read(Watts(watts), 1.0);
        }
        model.mean_correction().gain
    };
    assert_eq!(read(0.004, 1), 1.0);
    assert!((read(4.4, 1) - 1.1).abs() < 1e-9);
    // A map of other watts altogether is corrected as far as a correction goes.
    let mut model = PowerModel::default();
    for _ in 0..30 {
        (0..60).for_each(|_| model.predict(Watts(90.0), FRAME));
        model.read(Watts(4.5), 1.0);
    }
    assert_eq!(model.mean_correction().gain, 0.1);
}

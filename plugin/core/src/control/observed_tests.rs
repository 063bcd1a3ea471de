//! Limits in other currencies on a simulated device.

use std::time::Duration;

use super::*;
use crate::control::limits::resolve;
use crate::control::{Budget, CameraController, ControlSettings, Inputs, Limit, Outcome};
use crate::frontier::FrontierMap;
use crate::knobs::KnobLevels;
use crate::testing;
use crate::testing::SimulatedDevice;

/// A controlled app on a machine with a battery. Its settings take 4 W to 14 W.
struct Loop {
    map: FrontierMap,
    controller: CameraController,
    signals: SignalModel,
    device: SimulatedDevice,
    budget: Budget,
    current: Option<KnobLevels>,
    now: f64,
    frame: f64,
    /// Power of all else, watts.
    others: f64,
    /// Energy left, joules.
    energy: f64,
    tells_power: bool,
    /// Seconds of a frame's work for each watt, beside 4 ms.
    seconds_per_watt: f64,
    /// Seconds of a frame's work whatever the settings.
    work: Option<f64>,
    /// Temperature at which the headroom is used up, kelvin above the room's.
    hottest: f64,
    /// Seconds of work, watts and headroom of each frame.
    frames: Vec<(f64, f64, f64)>,
    outcome: Option<Outcome>,
    binding: Option<Limit>,
}

impl Loop {
    fn new(budget: Budget, frame: f64) -> Self {
        Self {
            map: testing::steps(),
            controller: CameraController::default(),
            signals: SignalModel::default(),
            device: SimulatedDevice::default(),
            budget,
            current: None,
            now: 0.0,
            frame,
            others: 3.0,
            energy: f64::INFINITY,
            tells_power: true,
            seconds_per_watt: 0.0008,
            work: None,
            hottest: 1e9,
            frames: Vec::new(),
            outcome: None,
            binding: None,
        }
    }

    fn run(&mut self, seconds: f64) -> &mut Self {
        let end = self.now + seconds;
        while self.now < end - 1e-9 && self.energy > 0.0 {
            let mut observed = self.signals.observed();
            observed.cameras = 1;
            observed.range = Some((Watts(4.0), Watts(14.0)));
            let limits = resolve(&self.budget, &observed).expect("valid limits");
            let inputs = Inputs {
                store: &self.map,
                view: testing::view(),
                budget: Budget { peak: limits.peak, ..Budget::new(limits.power, limits.error) },
                delta_seconds: self.frame,
                current: self.current,
                correction: PowerCorrection::default(),
                mean_correction: PowerCorrection::default(),
                settings: ControlSettings::default(),
                errors: crate::control::ErrorFeedback::default(),
            };
            let found = self.controller.step(&inputs).expect("a decision");
            (self.current, self.outcome) = (Some(found.applied), Some(found.outcome));
            self.binding = limits.power_by.or(limits.peak_by);
            let power = self.device.step(found.uncorrected, self.frame).0;
            let work = self.work.unwrap_or(0.004 + self.seconds_per_watt * power);
            let (before, drawn) = (self.now, power + self.others);
            self.now += self.frame;
            self.energy -= drawn * self.frame;
            let headroom = 1.0 - self.device.temperature / self.hottest;
            self.frames.push((work, power, headroom));
            self.signals.step(&FrameSignals {
                predicted: Some(found.uncorrected),
                is_playing: true,
                delta_seconds: self.frame,
                now_seconds: self.now,
                frame_seconds: Some(work),
                // Drivers count in steps of 10 mWh.
                battery: self
                    .energy
                    .is_finite()
                    .then_some(Joules((self.energy.max(0.0) / 36.0).floor() * 36.0)),
                battery_power: self.tells_power.then_some(Watts(drawn)),
                is_battery_new: (before / 5.0).floor() < (self.now / 5.0).floor(),
                headroom: Some(headroom),
            });
        }
        self
    }

    /// Mean of a figure over the last `seconds`.
    fn mean(&self, seconds: f64, figure: impl Fn(&(f64, f64, f64)) -> f64) -> f64 {
        let count = (seconds / self.frame) as usize;
        let last = &self.frames[self.frames.len() - count..];
        last.iter().map(figure).sum::<f64>() / count as f64
    }
}

#[test]
fn two_more_hours_are_two_more_hours() {
    const HOURS: f64 = 7200.0;
    let until = Budget::default().with_battery_until(Duration::from_secs_f64(HOURS));
    for (watts, tells_power, others) in [
        (9.0, true, 3.0),
        (11.0, true, 3.0),
        (15.0, true, 3.0),
        (9.0, true, 4.5),
        (11.0, true, 4.5),
        (15.0, true, 1.0),
        (11.0, false, 3.0),
        (11.0, false, 4.5),
    ] {
        let mut app = Loop::new(until, 0.1);
        (app.energy, app.tells_power) = (watts * HOURS, tells_power);
        app.run(HOURS * 0.5);
        assert_eq!(app.binding, Some(Limit::Battery));
        // Half way the rest of the machine starts to draw more, or less.
        app.others = others;
        app.run(HOURS * 0.5);
        let missed = (HOURS - app.now) / HOURS;
        let unused = app.energy.max(0.0) / (watts * HOURS);
        println!(
            "    {:.0} Wh, others 3 W then {others} W, power {}: empty {:.2} % early, {:.2} % unused",
            watts * 2.0,
            if tells_power { "told" } else { "by energy" },
            100.0 * missed.max(0.0),
            100.0 * unused
        );
        assert!(missed <= 0.02 && unused <= 0.02, "{missed} early, {unused} unused");
    }
}

#[test]
fn too_little_charge_takes_the_cheapest_settings_and_says_so() {
    let mut app = Loop::new(Budget::default().with_battery_until(Duration::from_secs(3600)), 0.1);
    app.energy = 5.0 * 3600.0;
    app.run(60.0);
    assert_eq!(app.mean(10.0, |frame| frame.1), 4.0);
    let said = (app.outcome, app.binding);
    assert_eq!(said, (Some(Outcome::PowerCannotBeMet), Some(Limit::Battery)));
}

#[test]
fn a_frame_time_is_kept_and_used_also_when_the_device_gets_slower() {
    let limit = 0.011;
    let mut app =
        Loop::new(Budget::default().with_frame_time(Duration::from_secs_f64(limit)), 1.0 / 60.0);
    app.run(20.0);
    let first = app.mean(10.0, |frame| frame.0) / limit;
    app.seconds_per_watt *= 1.4;
    app.run(20.0);
    let slower = app.mean(10.0, |frame| frame.0) / limit;
    // Another operating point: gain and offset are told apart.
    app.budget = Budget::default().with_frame_time(Duration::from_secs_f64(limit * 1.2));
    app.run(20.0);
    let longer = app.mean(10.0, |frame| frame.0) / (limit * 1.2);
    println!(
        "    frame time of {:.1} %, slower {:.1} %, longer {:.1} % of its limit",
        100.0 * first,
        100.0 * slower,
        100.0 * longer
    );
    for share in [first, slower, longer] {
        assert!((0.88..=1.01).contains(&share), "{share}");
    }
    assert_eq!(app.binding, Some(Limit::FrameTime));
}

#[test]
fn what_was_before_the_scene_does_not_decide_how_a_frame_time_is_kept() {
    let limit = 0.011;
    // Seconds of work and of a frame: an app that loads, for a moment or longer, and an empty scene.
    for (work, frame, count) in [(0.24, 0.24, 1), (1.0, 1.0, 9), (0.0005, 1.0 / 60.0, 60)] {
        let budget = Budget::default().with_frame_time(Duration::from_secs_f64(limit));
        let mut app = Loop::new(budget, frame);
        app.work = Some(work);
        app.run(f64::from(count) * frame);
        (app.frame, app.work) = (1.0 / 60.0, None);
        app.run(30.0);
        let share = app.mean(10.0, |frame| frame.0) / limit;
        let last = app.frames[app.frames.len() - 600..].iter();
        let longest = last.map(|frame| frame.0).fold(0.0, f64::max) / limit;
        assert!((0.88..=1.01).contains(&share) && longest < 1.05, "{work} s: {share}, {longest}");
    }
}

#[test]
fn headroom_is_kept_without_a_limit_cycle() {
    let mut app = Loop::new(Budget::default().with_headroom(0.3), 1.0 / 30.0);
    app.hottest = 12.0;
    app.run(300.0);
    let (least, last) = (
        app.frames.iter().map(|frame| frame.2).fold(1.0, f64::min),
        app.mean(100.0, |frame| frame.1),
    );
    let range = app.frames[6000..]
        .iter()
        .fold((f64::MAX, 0.0_f64), |range, frame| (range.0.min(frame.1), range.1.max(frame.1)));
    println!(
        "    headroom of {least:.2} at least, {last:.2} W from {:.2} to {:.2}",
        range.0, range.1
    );
    assert!(least > 0.1, "{least}");
    // Where power and temperature agree: P = 4 W + 10 W × (1 − P / 12 W) / 0.3.
    assert!((last - 9.88).abs() < 0.6, "{last}");
    assert!(range.1 - range.0 < 1.2, "{range:?}");
}

#[test]
fn readings_that_are_none_teach_nothing() {
    let mut model = SignalModel::default();
    for odd in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        model.step(&FrameSignals {
            predicted: Some(Watts(7.0)),
            is_playing: true,
            delta_seconds: odd,
            now_seconds: odd,
            frame_seconds: Some(odd),
            battery: Some(Joules(1.0)),
            battery_power: Some(Watts(odd)),
            is_battery_new: true,
            headroom: None,
        });
        let observed = model.observed();
        assert_eq!((observed.frame_time, observed.battery_power), (None, None), "{odd}");
    }
}

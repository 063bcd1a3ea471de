//! Budgets on a simulated device: the plugin's controller in an app, along the records of docs/data/records.
//!
//! `make bench BENCH=simulated ARGS='[changes] [battery] [SCENE]…'`. Every frame takes the recorded power of
//! the settings in effect, which the map only predicts; a device turns it into watts, and a meter with an
//! interval and noise says what it took. The camera goes along the path and back. No frame is rendered, so
//! figures are the same in every run.

use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::App;
use bevy::asset::{AssetPlugin, Assets};
use bevy::camera::{PerspectiveProjection, Projection};
use bevy::ecs::entity::Entity;
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::{GlobalTransform, Transform};
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, Selection};
use bevy_frugal_gi::frontier::{FrontierMap, FrontierMapPlugin};
use bevy_frugal_gi::knobs::KnobLevels;
use bevy_frugal_gi::power::{MeterInfo, MeterState, MeteredPower, Provenance};
use bevy_frugal_gi::signals::{BatteryLevel, BatterySettings};
use bevy_frugal_gi::units::{Joules, Watts};
use frugal_core::testing::{SimulatedDevice, SimulatedMeter};
use frugal_search::evaluate::PathRecord;
use frugal_search::testing::read_records;
use frugal_tests::arguments::Arguments;
use frugal_tests::folder;
use frugal_tests::table::markdown;

/// Seconds of a run, and those at its start that do not count.
const SECONDS: f64 = 360.0;
const SETTLE: f64 = 60.0;
/// Interval of the meter's readings, seconds, and their noise as a share.
const INTERVAL: f64 = 0.1;
const NOISE: f64 = 0.02;
/// Windows of the horizon above the budget by more than this share count as over.
const TOLERANCE: f64 = 0.02;
/// Seconds that a battery must last, between its readings, and the watt-hours of a step that it reports.
const BATTERY_SECONDS: f64 = 7200.0;
const BATTERY_INTERVAL: f64 = 5.0;
const BATTERY_STEP_WH: f64 = 0.01;

/// A record and its map.
struct Level {
    name: String,
    map: FrontierMap,
    record: PathRecord,
    rate: f64,
}

/// What the machine does beside.
#[derive(Clone, Copy)]
struct Machine {
    gain: f64,
    /// From the middle of the run on.
    clock_later: f64,
    gain_later: f64,
    loses_meter: bool,
    /// The view jumps to the other end of the tour in the middle.
    cuts: bool,
    /// Frames per second that a limiter allows, as a share of the map's.
    limiter: Option<f64>,
    /// Power that a governor keeps by its clock, as a share of the budget.
    governor: Option<f64>,
}

const PLAIN: Machine = Machine {
    gain: 1.0,
    clock_later: 1.0,
    gain_later: 1.0,
    loses_meter: false,
    cuts: false,
    limiter: None,
    governor: None,
};

/// One frame of a run.
#[derive(Clone, Copy)]
struct Frame {
    at: f64,
    seconds: f64,
    watts: f64,
    error: f64,
    settings: KnobLevels,
}

/// An app with one controlled camera.
struct Simulated<'a> {
    level: &'a Level,
    app: App,
    camera: Entity,
}

impl<'a> Simulated<'a> {
    fn new(level: &'a Level, budget: Budget) -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), FrontierMapPlugin, ControlPlugin));
        app.finish();
        app.cleanup();
        let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(level.map.clone());
        let [width, height] = level.map.capture.size.map(|side| side as f32);
        let lens = PerspectiveProjection {
            fov: level.map.capture.vertical_fov,
            aspect_ratio: width / height,
            ..Default::default()
        };
        let parts =
            (PowerController(map), Projection::Perspective(lens), GlobalTransform::IDENTITY);
        let camera = app.world_mut().spawn((parts, budget)).id();
        Self { level, app, camera }
    }

    fn read(&mut self, reading: Option<(Watts, f64)>, is_lost: bool) {
        let mut metered = self.app.world_mut().get_resource_or_init::<MeteredPower>();
        if is_lost {
            metered.state = MeterState::Lost { reason: "unplugged".into() };
            (metered.latest, metered.mean, metered.interval) = (None, None, None);
        } else if let Some((watts, seconds)) = reading {
            (metered.latest, metered.mean) = (Some(watts), Some(watts));
            metered.interval = Some(Duration::from_secs_f64(seconds));
            metered.sample_count += 1;
            metered.info = Some(MeterInfo {
                name: "simulated".into(),
                provenance: Provenance::Measured,
                description: String::new(),
            });
            metered.state = MeterState::Running;
        }
    }

    /// One frame of the controller, with the view of frame `at` of the path.
    fn update(&mut self, at: usize, seconds: f64) -> (KnobLevels, KnobLevels) {
        let pose = &self.level.record.path.poses()[at];
        let place = Transform::from_translation(pose.position).with_rotation(pose.rotation);
        self.app.world_mut().entity_mut(self.camera).insert(GlobalTransform::from(place));
        let step = TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(seconds));
        self.app.insert_resource(step);
        self.app.update();
        let selection =
            self.app.world().get::<Selection>(self.camera).expect("a controlled camera");
        (selection.applied, selection.target)
    }
}

/// Frames of a run under a mean power of `limit`.
fn run(level: &Level, limit: Watts, machine: &Machine) -> Vec<Frame> {
    let mut app = Simulated::new(level, Budget::power(limit));
    let mut device = SimulatedDevice { gain: machine.gain, ..Default::default() };
    let mut meter = SimulatedMeter::new(INTERVAL).with_noise(NOISE);
    let (record, count) = (&level.record, level.record.path.poses().len());
    let (mut last, mut shown, mut frames) =
        (None, <(KnobLevels, KnobLevels)>::default(), Vec::new());
    // The governor's clock, and the mean power that it sees.
    let (mut clock, mut seen) = (1.0_f64, 0.0_f64);
    let mut time = 0.0;
    while time < SECONDS {
        let half = time >= 0.5 * SECONDS;
        if half {
            device.gain = machine.gain * machine.gain_later;
        }
        let step = (time * level.rate) as usize;
        let at = there_and_back(if machine.cuts && half { step + count / 2 } else { step }, count);
        // Settings take effect in the next frame.
        let cost = record.cost(at, shown.0, shown.1, &mut last);
        // The best settings fit the map's rate at full clock.
        let later = if half { machine.clock_later } else { 1.0 };
        let share = machine.limiter.unwrap_or(1.0).min(clock * later);
        let frame = 1.0 / (level.rate * share);
        // Energy of a frame falls with the square of the clock, and there are fewer frames.
        let demand = Watts(cost.power.0 * share * (clock * later).powi(2));
        let watts = device.step(demand, frame);
        app.read(meter.step(watts, frame), machine.loses_meter && half);
        frames.push(Frame {
            at: time,
            seconds: frame,
            watts: watts.0,
            error: cost.error,
            settings: shown.0,
        });
        if let Some(share) = machine.governor {
            // A second's mean, and a clock that follows it slowly, as those of handhelds do.
            seen += (watts.0 - seen) * frame.min(1.0);
            let wanted = (share * limit.0 / seen.max(1e-6)).cbrt() * clock;
            clock += (wanted.clamp(0.4, 1.0) - clock) * (frame / 0.5).min(1.0);
        }
        shown = app.update(at, frame);
        time += frame;
    }
    frames
}

/// Where a step of a walk to and fro is on a path of `count` poses.
fn there_and_back(step: usize, count: usize) -> usize {
    let along = step % (2 * count);
    along.min(2 * count - 1 - along)
}

/// Share of the windows of the horizon that are over `limit`.
fn windows_over(frames: &[Frame], limit: Watts) -> f64 {
    let (mut first, mut joules, mut seconds) = (0, 0.0, 0.0);
    let (mut over, mut windows) = (0, 0);
    for frame in frames {
        joules += frame.watts * frame.seconds;
        seconds += frame.seconds;
        while seconds - frames[first].seconds >= Budget::HORIZON.as_secs_f64() {
            joules -= frames[first].watts * frames[first].seconds;
            seconds -= frames[first].seconds;
            first += 1;
        }
        if first > 0 {
            windows += 1;
            over += usize::from(joules / seconds > limit.0 * (1.0 + TOLERANCE));
        }
    }
    over as f64 / f64::from(windows.max(1))
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The limit at `share` of the way from the cheapest to the best settings' mean power.
fn limit_at(level: &Level, share: f64) -> Watts {
    let [low, high] = level.record.power_range();
    low + (high - low) * share
}

/// What changes half way, and other controllers of the machine.
fn changes(level: &Level) {
    let cases: [(&str, Machine); 9] = [
        ("the map's own", PLAIN),
        ("1.4 times hungrier from the start", Machine { gain: 1.4, ..PLAIN }),
        ("1.4 times hungrier half way", Machine { gain_later: 1.4, ..PLAIN }),
        ("throttles to 0.8 of its clock", Machine { clock_later: 0.8, ..PLAIN }),
        ("loses its meter", Machine { gain: 1.2, loses_meter: true, ..PLAIN }),
        ("camera cut, 1.4 times hungrier", Machine { gain: 1.4, cuts: true, ..PLAIN }),
        ("frame limiter at 75 %", Machine { limiter: Some(0.75), ..PLAIN }),
        ("automatic TDP at the budget", Machine { governor: Some(1.0), ..PLAIN }),
        ("automatic TDP at 90 % of it", Machine { governor: Some(0.9), ..PLAIN }),
    ];
    let mut rows = Vec::new();
    for (name, machine) in cases {
        for share in [0.3, 0.5, 0.7] {
            let limit = limit_at(level, share);
            let frames = run(level, limit, &machine);
            let from = frames.partition_point(|frame| frame.at < SETTLE);
            let counted = &frames[from..];
            let seconds: f64 = counted.iter().map(|frame| frame.seconds).sum();
            let mean = |value: fn(&Frame) -> f64| {
                counted.iter().map(|frame| value(frame) * frame.seconds).sum::<f64>() / seconds
            };
            let changes = |is_other: &dyn Fn(&KnobLevels, &KnobLevels) -> bool| {
                let pairs = counted.windows(2);
                let found = pairs.filter(|pair| is_other(&pair[0].settings, &pair[1].settings));
                60.0 * found.count() as f64 / seconds
            };
            let knobs = level.map.knobs.knobs().iter().enumerate();
            let by_knob = knobs.map(|(index, knob)| {
                (knob.name.as_str(), changes(&|a, b| a.level(index) != b.level(index)))
            });
            let busiest = by_knob.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
            rows.push(vec![
                name.to_owned(),
                percent(share),
                percent(mean(|frame| frame.watts) / limit.0),
                percent(windows_over(counted, limit)),
                format!("{:.4}", mean(|frame| frame.error)),
                format!("{:.0}", changes(&|a, b| a != b)),
                format!("{}, {:.0}", busiest.0, busiest.1),
            ]);
        }
    }
    let heads =
        ["machine", "budget", "used", "windows over", "error", "changes a minute", "busiest knob"];
    println!("\n## {}: power\n\n{}", level.name, markdown(&heads, &rows));
}

/// "Two more hours" on a device of half again the map's watts, by the battery alone.
fn battery(level: &Level) {
    let mut rows = Vec::new();
    for share in [0.3, 0.5, 0.7] {
        let gain = 1.5;
        let mut left = gain * limit_at(level, share).0 * BATTERY_SECONDS;
        let start = left;
        let until = Duration::from_secs_f64(BATTERY_SECONDS);
        let mut app = Simulated::new(level, Budget::default().with_battery_until(until));
        app.app.insert_resource(BatterySettings { enabled: false });
        let count = level.record.path.poses().len();
        let (mut last, mut shown) = (None, <(KnobLevels, KnobLevels)>::default());
        let (mut time, mut read_at, mut error) = (0.0, 0.0, 0.0);
        while time < BATTERY_SECONDS && left > 0.0 {
            if time >= read_at {
                let step = 3600.0 * BATTERY_STEP_WH;
                let energy = Some(Joules((left / step).floor() * step));
                app.app.insert_resource(BatteryLevel { energy, power: None });
                read_at += BATTERY_INTERVAL;
            }
            let at = there_and_back((time * level.rate) as usize, count);
            let cost = level.record.cost(at, shown.0, shown.1, &mut last);
            let frame = 1.0 / level.rate;
            left -= gain * cost.power.0 * frame;
            error += cost.error * frame;
            shown = app.update(at, frame);
            time += frame;
        }
        let early = if left > 0.0 { 0.0 } else { 1.0 - time / BATTERY_SECONDS };
        rows.push(vec![
            percent(share),
            percent(early),
            percent(left.max(0.0) / start),
            format!("{:.4}", error / time),
        ]);
    }
    let heads = ["of the range", "empty early", "unused", "error"];
    println!("\n## {}: two more hours\n\n{}", level.name, markdown(&heads, &rows));
}

/// The parts of the benchmark, all of which run unless some are named.
const PARTS: [(&str, fn(&Level)); 2] = [("changes", changes), ("battery", battery)];

fn main() {
    let options =
        Arguments { size: Default::default(), samples: 0, count: 0, names: vec![] }.read();
    let (parts, scenes): (Vec<&String>, Vec<&String>) =
        options.names.iter().partition(|name| PARTS.iter().any(|(part, _)| part == name));
    let records = read_records(&folder::workspace().join("docs/data/records"));
    for (file, map) in records.unwrap_or_else(|error| panic!("{error}")) {
        if !scenes.is_empty() && scenes.iter().all(|scene| **scene != file.scene) {
            continue;
        }
        let record = file.record(&map.knobs).unwrap_or_else(|error| panic!("{error}"));
        let name = format!("{}, {}", file.scene, file.path);
        let level = Level { name, map, record, rate: file.fps };
        for (name, part) in PARTS {
            if parts.is_empty() || parts.iter().any(|asked| *asked == name) {
                part(&level);
            }
        }
    }
}

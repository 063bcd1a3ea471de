//! Power budgets on a simulated device: the plugin's controller in an app, along recorded paths.
//!
//! `make bench BENCH=simulated ARGS='[budgets] [changes] [company] SCENE MAP RECORD …'`, three
//! arguments for each scene. The record of its `tour` is that of `frugal evaluate --record`, made
//! with the map.
//!
//! Every frame takes the recorded power of the settings in effect, which the map only predicts; a
//! device turns it into watts, and a meter with an interval and noise says what it took. The camera
//! goes along the tour and back. No frame is rendered, so figures are the same in every run.

use std::path::Path;
use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::App;
use bevy::asset::{AssetPlugin, Assets};
use bevy::camera::{PerspectiveProjection, Projection};
use bevy::ecs::entity::Entity;
use bevy::math::{Quat, Vec3};
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::{GlobalTransform, Transform};
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, Selection};
use bevy_frugal_gi::frontier::{FrontierMap, FrontierMapPlugin};
use bevy_frugal_gi::knobs::KnobLevels;
use bevy_frugal_gi::power::{MeterInfo, MeterState, MeteredPower, Provenance};
use bevy_frugal_gi::units::Watts;
use frugal::scene::{self, SceneDescription};
use frugal_core::frontier::CostPoint;
use frugal_core::testing::{SimulatedDevice, SimulatedMeter};
use frugal_search::evaluate::{
    PathPlan, PathRecord, Policy, Pose, Reactive, ResolvedBudget, best_constant, ladder,
};
use frugal_search::journal::read_journal;
use frugal_tests::table::markdown;

/// Seconds of a run, and those at its start that do not count.
const SECONDS: f64 = 60.0;
const SETTLE: f64 = 3.0;
/// Interval of the meter's readings, seconds, and their noise as a share.
const INTERVAL: f64 = 0.1;
const NOISE: f64 = 0.02;
/// 1 s windows above the budget by more than this share count as over.
const TOLERANCE: f64 = 0.02;

/// One scene's map and record.
struct Level {
    name: String,
    map: FrontierMap,
    record: PathRecord,
}

/// Who selects the settings.
#[derive(Clone, Copy, PartialEq)]
enum Method {
    Frugal,
    BestConstant,
    Reactive,
}

/// What the machine does beside.
#[derive(Clone, Copy)]
struct Machine {
    gain: f64,
    /// From the middle of the run on.
    clock_later: f64,
    gain_later: f64,
    loses_meter: bool,
    /// The budget is lifted for the second quarter: the machine is on its charger.
    is_plugged: bool,
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
    is_plugged: false,
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
    target: KnobLevels,
    is_limited: bool,
}

/// An app with one controlled camera.
struct Simulated<'a> {
    level: &'a Level,
    app: App,
    camera: Entity,
}

impl<'a> Simulated<'a> {
    fn new(level: &'a Level) -> Self {
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
        let camera = app.world_mut().spawn((parts, Budget::default())).id();
        Self { level, app, camera }
    }

    fn set_budget(&mut self, limit: Option<Watts>) {
        let budget = limit.map_or(Budget::default(), Budget::power);
        self.app.world_mut().entity_mut(self.camera).insert(budget);
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

/// Runs `method` under a mean power of `limit` for `seconds`.
fn run(level: &Level, method: Method, limit: Watts, machine: &Machine, seconds: f64) -> Vec<Frame> {
    let mut app = Simulated::new(level);
    let rate = level.map.capture.frames_per_second;
    let mut device = SimulatedDevice { gain: machine.gain, ..Default::default() };
    let mut meter = SimulatedMeter::new(INTERVAL).with_noise(NOISE);
    let (record, poses) = (&level.record, level.record.path.poses());
    let budget = ResolvedBudget { power_w: Some(limit), ..Default::default() };
    let mut reactive = Reactive::new(ladder(&level.map.shared), budget);
    let constant =
        best_constant(&record.table, &budget).map_or_else(KnobLevels::default, |it| it.0);
    let (mut last, mut shown, mut frames) = (None, (constant, constant), Vec::new());
    // The governor's clock, and the mean power that it sees.
    let (mut clock, mut seen) = (1.0_f64, 0.0_f64);
    let (mut time, mut metered, mut is_late) = (0.0, limit, false);
    let period = 2 * poses.len();
    while time < seconds {
        let half = time >= 0.5 * seconds;
        if half && !is_late {
            is_late = true;
            device.gain = machine.gain * machine.gain_later;
        }
        let step = (time * rate) as usize;
        let step = if machine.cuts && half { step + poses.len() / 2 } else { step };
        let along = step % period;
        let at = along.min(period - 1 - along);
        let is_plugged = machine.is_plugged && (0.25..0.5).contains(&(time / seconds));
        app.set_budget((!is_plugged).then_some(limit));
        // Settings take effect in the next frame.
        let (settings, target) = shown;
        let cost = record.cost(at, settings, target, &mut last);
        // The best settings fit the map's rate at full clock.
        let later = if half { machine.clock_later } else { 1.0 };
        let share = machine.limiter.unwrap_or(1.0).min(clock * later);
        let frame = 1.0 / (rate * share);
        // Energy of a frame falls with the square of the clock, and there are fewer frames.
        let demand = Watts(cost.power.0 * share * (clock * later).powi(2));
        let watts = device.step(demand, frame);
        let is_lost = machine.loses_meter && half;
        let reading = meter.step(watts, frame);
        app.read(reading, is_lost);
        metered = reading.map_or(metered, |(watts, _)| watts);
        frames.push(Frame {
            at: time,
            seconds: frame,
            watts: watts.0,
            error: cost.error,
            settings,
            target,
            is_limited: !is_plugged,
        });
        if let Some(share) = machine.governor {
            // A second's mean, and a clock that follows it slowly, as those of handhelds do.
            seen += (watts.0 - seen) * frame.min(1.0);
            let wanted = (share * limit.0 / seen.max(1e-6)).cbrt() * clock;
            clock += (wanted.clamp(0.4, 1.0) - clock) * (frame / 0.5).min(1.0);
        }
        shown = match method {
            Method::Frugal => app.update(at, frame),
            Method::BestConstant => (constant, constant),
            Method::Reactive => {
                reactive.observe(CostPoint::new(metered.0, 0.0));
                let settings = reactive.decide(0, frame, &poses[0]).settings;
                (settings, settings)
            }
        };
        time += frame;
    }
    frames
}

/// Mean power of the second that ends with each limited frame, from `SETTLE` on.
fn windows(frames: &[Frame]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for (index, end) in frames.iter().enumerate() {
        let inside = frames[..=index]
            .iter()
            .rev()
            .take_while(|frame| frame.at > end.at - 1.0 + 1e-9)
            .collect::<Vec<_>>();
        if end.at < SETTLE || inside.iter().any(|frame| !frame.is_limited) {
            continue;
        }
        let seconds: f64 = inside.iter().map(|frame| frame.seconds).sum();
        let joules: f64 = inside.iter().map(|frame| frame.watts * frame.seconds).sum();
        found.push((end.at, joules / seconds));
    }
    found
}

fn is_over(watts: f64, limit: Watts) -> bool {
    watts > limit.0 * (1.0 + TOLERANCE)
}

struct Figures {
    used: f64,
    over: f64,
    error: f64,
    /// Changes of the selected settings in a second, and of the busiest knob's level.
    targets: f64,
    busiest: f64,
}

impl Figures {
    fn entry(&self) -> String {
        format!("{}, {}, {:.4}", percent(self.used), percent(self.over), self.error)
    }
}

fn figures(level: &Level, frames: &[Frame], limit: Watts) -> Figures {
    let counted: Vec<&Frame> =
        frames.iter().filter(|frame| frame.at >= SETTLE && frame.is_limited).collect();
    let seconds: f64 = counted.iter().map(|frame| frame.seconds).sum();
    let mean = |value: fn(&Frame) -> f64| {
        counted.iter().map(|frame| value(frame) * frame.seconds).sum::<f64>() / seconds
    };
    let windows = windows(frames);
    let over = windows.iter().filter(|(_, watts)| is_over(*watts, limit)).count();
    let targets = counted.windows(2).filter(|pair| pair[0].target != pair[1].target).count();
    let switches = |knob: usize| {
        counted
            .windows(2)
            .filter(|pair| pair[0].settings.level(knob) != pair[1].settings.level(knob))
            .count()
    };
    let busiest = (0..level.map.knobs.len()).map(switches).max().unwrap_or(0);
    Figures {
        used: mean(|frame| frame.watts) / limit.0,
        over: over as f64 / windows.len().max(1) as f64,
        error: mean(|frame| frame.error),
        targets: targets as f64 / seconds,
        busiest: busiest as f64 / seconds,
    }
}

/// Seconds from `event` until no 1 s window of the next ten seconds is over. The window that ends
/// with the event counts from its own excess on.
fn recovery(frames: &[Frame], event: f64, limit: Watts) -> f64 {
    windows(frames)
        .iter()
        .filter(|(at, watts)| (event..event + 10.0).contains(at) && is_over(*watts, limit))
        .map(|(at, _)| at - event)
        .fold(0.0, f64::max)
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The limit at `share` of the way from the cheapest to the best settings' mean power.
fn limit_at(level: &Level, share: f64) -> Watts {
    let [low, high] = level.record.power_range();
    low + (high - low) * share
}

fn budgets(level: &Level) {
    println!("\n## {}: budgets on the map's own device\n", level.name);
    let mut rows = Vec::new();
    for percents in (20..=100).step_by(10) {
        let limit = limit_at(level, f64::from(percents) / 100.0);
        let of = |method| figures(level, &run(level, method, limit, &PLAIN, SECONDS), limit);
        let [ours, constant, reactive] =
            [Method::Frugal, Method::BestConstant, Method::Reactive].map(of);
        rows.push(vec![
            format!("{percents} %: {:.2} W", limit.0),
            ours.entry(),
            format!("{:.2}, {:.2}", ours.targets, ours.busiest),
            constant.entry(),
            reactive.entry(),
        ]);
    }
    let heads = [
        "budget",
        "frugal: used, windows over, error",
        "targets and switches of the busiest knob a second",
        "best constant",
        "reactive",
    ];
    println!("{}", markdown(&heads, &rows));
}

fn changes(level: &Level) {
    println!("\n## {}: the machine changes half way\n", level.name);
    let half = 0.5 * SECONDS;
    // When the change comes, in seconds.
    let cases: [(&str, f64, Machine); 7] = [
        ("1.4 times hungrier from the start", 0.0, Machine { gain: 1.4, ..PLAIN }),
        ("1.4 times hungrier half way", half, Machine { gain_later: 1.4, ..PLAIN }),
        ("throttles to 0.8 of its clock", half, Machine { clock_later: 0.8, ..PLAIN }),
        ("loses its meter", half, Machine { gain: 1.2, loses_meter: true, ..PLAIN }),
        ("plugged in, and out half way", half, Machine { is_plugged: true, ..PLAIN }),
        ("camera cut", half, Machine { cuts: true, ..PLAIN }),
        ("camera cut, 1.4 times hungrier", half, Machine { gain: 1.4, cuts: true, ..PLAIN }),
    ];
    let mut rows = Vec::new();
    for (name, event, machine) in cases {
        for share in [0.4, 0.6, 0.8] {
            let limit = limit_at(level, share);
            let of = |method| run(level, method, limit, &machine, SECONDS);
            let (ours, reactive) = (of(Method::Frugal), of(Method::Reactive));
            let (mine, theirs) = (figures(level, &ours, limit), figures(level, &reactive, limit));
            rows.push(vec![
                name.to_owned(),
                percent(share),
                mine.entry(),
                format!("{:.1} s", recovery(&ours, event, limit)),
                format!("{:.2}", mine.busiest),
                theirs.entry(),
                format!("{:.1} s", recovery(&reactive, event, limit)),
            ]);
        }
    }
    let heads = [
        "machine",
        "budget",
        "frugal: used, over, error",
        "back within",
        "switches/s",
        "reactive",
        "back within",
    ];
    println!("{}", markdown(&heads, &rows));
}

/// Share of the variance of the power's second means that the strongest period between 2 and 30
/// seconds has, beyond those of the tour itself.
fn strongest_period(frames: &[Frame], tour: f64) -> (f64, f64) {
    let values: Vec<(f64, f64)> =
        frames.iter().filter(|it| it.at > 10.0).map(|it| (it.at, it.watts)).collect();
    let mean = values.iter().map(|(_, watts)| watts).sum::<f64>() / values.len().max(1) as f64;
    let variance = values.iter().map(|(_, watts)| (watts - mean).powi(2)).sum::<f64>();
    let mut best = (0.0, 0.0);
    for step in 0..300 {
        let period = 2.0 * (30.0_f64 / 2.0).powf(f64::from(step) / 299.0);
        // Harmonics of there and back belong to the scene.
        let harmonic = 2.0 * tour / period;
        if (harmonic - harmonic.round()).abs() < 0.15 {
            continue;
        }
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (at, watts) in &values {
            let angle = std::f64::consts::TAU * at / period;
            (sine, cosine) =
                (sine + (watts - mean) * angle.sin(), cosine + (watts - mean) * angle.cos());
        }
        let share = 2.0 * (sine * sine + cosine * cosine) / (values.len() as f64 * variance);
        if share > best.1 {
            best = (period, share);
        }
    }
    best
}

fn company(level: &Level) {
    println!("\n## {}: ten minutes beside other controllers, budget of 60 %\n", level.name);
    let limit = limit_at(level, 0.6);
    let tour = level.record.path.poses().len() as f64 / level.map.capture.frames_per_second;
    let mut rows = Vec::new();
    let cases: [(&str, Machine); 5] = [
        ("none", PLAIN),
        ("frame limiter at 75 %", Machine { limiter: Some(0.75), ..PLAIN }),
        ("automatic TDP at the budget", Machine { governor: Some(1.0), ..PLAIN }),
        ("automatic TDP at 90 % of it", Machine { governor: Some(0.9), ..PLAIN }),
        ("both, TDP at the budget", Machine { governor: Some(1.0), limiter: Some(0.75), ..PLAIN }),
    ];
    for (name, machine) in cases {
        let mut entries = vec![name.to_owned()];
        for method in [Method::Frugal, Method::BestConstant, Method::Reactive] {
            let frames = run(level, method, limit, &machine, 600.0);
            let found = figures(level, &frames, limit);
            let (period, share) = strongest_period(&frames, tour);
            let last = frames.len() as f64 / 600.0;
            entries.push(format!(
                "{}, {} over, {:.4}, {last:.1} frames/s, {:.2} switches/s, {:.0} % at {period:.1} s",
                percent(found.used),
                percent(found.over),
                found.error,
                found.busiest,
                100.0 * share
            ));
        }
        rows.push(entries);
    }
    println!("{}", markdown(&["beside", "frugal", "best constant", "reactive"], &rows));
}

/// Power and error of a map's settings at every frame of the scene's tour, as
/// `frugal evaluate --record` wrote them to `file`.
fn read_record(
    file: &Path,
    scene: &SceneDescription,
    map: &FrontierMap,
) -> Result<PathRecord, String> {
    let tour = scene.paths.get("tour").ok_or("the scene has no path `tour`")?;
    let fps = map.capture.frames_per_second;
    let plan = PathPlan::sample("tour", f64::from(tour.duration()), fps, |seconds| {
        let pose = tour.sample(tour.start() + seconds as f32);
        pose.unwrap_or(Pose { position: Vec3::ZERO, rotation: Quat::IDENTITY })
    })?;
    let (_, lines) = read_journal(file)
        .map_err(|error| format!("{error}; `frugal evaluate --record` writes such a file"))?;
    let record = PathRecord::restore(&plan, &map.knobs, &lines);
    if record.table.settings().is_empty() {
        let file = file.display();
        return Err(format!("{file}: no complete run of `tour` at {fps} frames per second"));
    }
    Ok(record)
}

/// The parts of the benchmark, all of which run unless some are named.
const PARTS: [(&str, fn(&Level)); 3] =
    [("budgets", budgets), ("changes", changes), ("company", company)];

fn main() {
    let is_part = |argument: &String| PARTS.iter().any(|(name, _)| name == argument);
    let given = std::env::args().skip(1).filter(|argument| argument != "--bench");
    let (parts_asked, arguments): (Vec<String>, Vec<String>) = given.partition(is_part);
    if arguments.is_empty() || !arguments.len().is_multiple_of(3) {
        eprintln!(
            "simulated: give SCENE MAP RECORD, once or several times; `frugal precompute` and `frugal evaluate --record` write the latter two"
        );
        std::process::exit(2);
    }
    for parts in arguments.chunks(3) {
        let [scene, map, record] = [0, 1, 2].map(|part| Path::new(&parts[part]));
        let name = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let read = || -> Result<Level, String> {
            let description = scene::load(scene).map_err(|error| error.to_string())?;
            let text = std::fs::read_to_string(map).map_err(|error| error.to_string())?;
            let map = FrontierMap::from_ron(&text).map_err(|error| error.to_string())?;
            let record = read_record(record, &description, &map)?;
            Ok(Level { name, map, record })
        };
        let level = read().unwrap_or_else(|error| {
            eprintln!("simulated: {error}");
            std::process::exit(2);
        });
        for (name, part) in PARTS {
            if parts_asked.is_empty() || parts_asked.iter().any(|asked| asked == name) {
                part(&level);
            }
        }
    }
}

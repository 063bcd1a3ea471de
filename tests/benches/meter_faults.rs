//! Power budgets under meters that are late, lie, freeze and come back: the plugin's controller in an
//! app, on a simulated device.
//!
//! `make bench BENCH=meter_faults`
//!
//! The camera travels through eight places whose settings take from 4 to 14 W times a factor of the
//! place. The map is off by a few percent at each, and the device takes 1.2 times the map's power and
//! 1 W more. No frame is rendered, so figures are the same in every run.

use std::time::Duration;

use bevy::MinimalPlugins;
use bevy::app::App;
use bevy::asset::{AssetPlugin, Assets};
use bevy::math::Vec3;
use bevy::time::TimeUpdateStrategy;
use bevy::transform::components::{GlobalTransform, Transform};
use bevy_frugal_gi::control::{Budget, ControlPlugin, PowerController, Selection};
use bevy_frugal_gi::frontier::{
    CostPoint, Frontier, FrontierMap, FrontierMapPlugin, FrontierPoint,
};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSpace};
use bevy_frugal_gi::power::{MeterInfo, MeterState, MeteredPower, Provenance};
use bevy_frugal_gi::units::Watts;
use frugal_core::testing::{SimulatedDevice, SimulatedMeter};
use frugal_tests::map;
use frugal_tests::table::markdown;

const FRAME: f64 = 1.0 / 60.0;
/// Seconds of a run, those at its start that do not count, and the time at each place.
const SECONDS: f64 = 180.0;
const SETTLE: f64 = 5.0;
const PLACE_SECONDS: f64 = 3.0;
/// When the meter freezes, when that is noticed, and when it comes back, seconds.
const FREEZES: f64 = 60.0;
const NOTICED: f64 = 65.0;
const RETURNS: f64 = 120.0;
/// Factor of a place's power, and what the map is off there.
const PLACES: [(f64, f64); 8] = [
    (0.7, 0.97),
    (1.0, 1.04),
    (1.3, 1.0),
    (0.9, 1.05),
    (1.1, 0.95),
    (0.8, 1.02),
    (1.2, 0.98),
    (1.0, 0.99),
];

/// What is wrong with the meter.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    NoMeter,
    Late,
    Doubles,
    Halves,
    Freezes,
    /// And the device takes 1.4 times the power from then on.
    FreezesOnHungrier,
}

const FAULTS: [(&str, Fault); 7] = [
    ("none", Fault::None),
    ("no meter", Fault::NoMeter),
    ("30 s late", Fault::Late),
    ("reads twice the power", Fault::Doubles),
    ("reads half of the power", Fault::Halves),
    ("frozen from 60 to 120 s", Fault::Freezes),
    ("the same, device 1.4 times hungrier meanwhile", Fault::FreezesOnHungrier),
];

/// Settings of step `step` of 20.
fn levels(step: usize) -> KnobLevels {
    KnobLevels::default().with_level(0, step / 2).with_level(1, step.div_ceil(2))
}

fn watts(levels: KnobLevels) -> f64 {
    4.0 + 10.0 * (levels.level(0) + levels.level(1)) as f64 / 19.0
}

/// One place at each corner of a cube.
fn places() -> FrontierMap {
    let knobs = ["a", "b"].map(|name| Knob::new(name, (0..11).map(f64::from)));
    let mut map = map::one_cube(KnobSpace::new(knobs.to_vec()).expect("a space"));
    map.capture.frames_per_second = 1.0 / FRAME;
    let frontier = |(factor, _): (f64, f64)| {
        Frontier::from_points((0..20).map(|step| {
            let power = watts(levels(step));
            let cost = CostPoint::new(power * factor, 0.4 / power - 0.4 / 14.0);
            FrontierPoint { settings: levels(step), cost }
        }))
    };
    map.octree.frontiers = PLACES.map(frontier).to_vec();
    for (number, corner) in (0..).zip(&mut map.octree.corners) {
        corner.frontiers = [number; 6];
    }
    map.validate().unwrap_or_else(|error| panic!("{error}"));
    map
}

/// The corner of a place, where a camera finds its frontier.
fn position(map: &FrontierMap, place: usize) -> Vec3 {
    let at = map.octree.corners[place].at;
    Vec3::from_array(at.map(|side| if side == 0 { -9.0 } else { 9.0 }))
}

/// Power and metered power of each frame's end.
struct Run {
    frames: Vec<(f64, f64)>,
}

fn run(limit: Watts, fault: Fault) -> Run {
    let map = places();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), FrontierMapPlugin, ControlPlugin));
    let step = TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(FRAME));
    app.insert_resource(step);
    app.finish();
    app.cleanup();
    let handle = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(map.clone());
    let parts = (PowerController(handle), Budget::power(limit), GlobalTransform::IDENTITY);
    let camera = app.world_mut().spawn(parts).id();
    let mut device = SimulatedDevice { gain: 1.2, idle: Watts(1.0), ..Default::default() };
    let latency = if fault == Fault::Late { 30.0 } else { 0.0 };
    let mut meter = SimulatedMeter::new(0.25).with_noise(0.02).with_latency(latency);
    let scale = match fault {
        Fault::Doubles => 2.0,
        Fault::Halves => 0.5,
        _ => 1.0,
    };
    let freezes = matches!(fault, Fault::Freezes | Fault::FreezesOnHungrier);
    let mut frames = Vec::new();
    let mut time = 0.0;
    while time < SECONDS {
        let place = (time / PLACE_SECONDS) as usize % PLACES.len();
        let transform = Transform::from_translation(position(&map, place));
        app.world_mut().entity_mut(camera).insert(GlobalTransform::from(transform));
        app.update();
        let applied = app.world().get::<Selection>(camera).expect("a selection").applied;
        if fault == Fault::FreezesOnHungrier && time >= FREEZES + 5.0 {
            device.gain = 1.2 * 1.4;
        }
        let (factor, off) = PLACES[place];
        let drawn = device.step(Watts(watts(applied) * factor * off), FRAME);
        let reading = meter.step(drawn * scale, FRAME);
        if fault != Fault::NoMeter {
            let is_frozen = freezes && (FREEZES..RETURNS).contains(&time);
            tell(&mut app, reading.filter(|_| !is_frozen), is_frozen && time >= NOTICED);
        }
        frames.push((drawn.0, drawn.0 * scale));
        time += FRAME;
    }
    Run { frames }
}

fn tell(app: &mut App, reading: Option<(Watts, f64)>, is_lost: bool) {
    let mut metered = app.world_mut().get_resource_or_init::<MeteredPower>();
    if is_lost {
        metered.state = MeterState::Lost { reason: "frozen".into() };
        (metered.latest, metered.mean, metered.interval) = (None, None, None);
    } else if let Some((watts, seconds)) = reading {
        (metered.latest, metered.mean) = (Some(watts), Some(watts));
        metered.interval = Some(Duration::from_secs_f64(seconds));
        metered.sample_count += 1;
        metered.state = MeterState::Running;
        metered.info = Some(MeterInfo {
            name: "simulated".into(),
            provenance: Provenance::Measured,
            description: String::new(),
        });
    }
}

impl Run {
    /// End of each 1 s window from `SETTLE` on that is over `limit` by 2 %; of the metered power, or
    /// the device's own.
    fn over(&self, limit: Watts, is_metered: bool) -> Vec<f64> {
        let frames = (1.0 / FRAME).round() as usize;
        let of = |(real, metered): &(f64, f64)| if is_metered { *metered } else { *real };
        let mean = |window: &[(f64, f64)]| window.iter().map(of).sum::<f64>() / frames as f64;
        let windows = self.frames.windows(frames).enumerate();
        let ends = windows.map(|(start, window)| ((start + frames) as f64 * FRAME, mean(window)));
        ends.filter(|(end, watts)| *end > SETTLE && *watts > limit.0 * 1.02)
            .map(|(end, _)| end)
            .collect()
    }

    /// Share of the limit that was used.
    fn used(&self, limit: Watts) -> f64 {
        let first = (SETTLE / FRAME) as usize;
        let counted = &self.frames[first..];
        counted.iter().map(|(real, _)| real).sum::<f64>() / counted.len() as f64 / limit.0
    }
}

/// Seconds from `event` until no window of the next 30 s is over.
fn held_after(over: &[f64], event: f64) -> f64 {
    let mut after = over.iter().rev().filter(|end| (event..event + 30.0).contains(*end));
    after.next().map_or(0.0, |end| end - event)
}

fn main() {
    let limits: Vec<(usize, Watts)> = (20..=100)
        .step_by(20)
        .map(|percent| (percent, Watts(1.0 + 1.2 * (4.0 + 10.0 * percent as f64 / 100.0))))
        .collect();
    let mut rows = Vec::new();
    for (name, fault) in FAULTS {
        for (percent, limit) in &limits {
            let run = run(*limit, fault);
            let windows = (SECONDS - SETTLE) / FRAME;
            let share = |over: &[f64]| format!("{:.1} %", 100.0 * over.len() as f64 / windows);
            let (real, metered) = (run.over(*limit, false), run.over(*limit, true));
            let event = match fault {
                Fault::FreezesOnHungrier => RETURNS,
                _ => 0.0,
            };
            rows.push(vec![
                name.to_owned(),
                format!("{percent} %: {:.1} W", limit.0),
                format!("{:.0} %", 100.0 * run.used(*limit)),
                share(&real),
                share(&metered),
                format!("{:.1} s", held_after(&real, event)),
            ]);
        }
    }
    let heads = [
        "meter",
        "budget",
        "used",
        "1 s windows over",
        "over by the meter",
        "held after the start, or after the meter's return",
    ];
    println!("{}", markdown(&heads, &rows));
}

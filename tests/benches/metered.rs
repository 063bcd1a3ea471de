//! Metered power of an app under budgets: the plugin's map, controller and closed loop, at the app's
//! own frame rate, with a meter of the device.
//!
//! `make bench BENCH=metered ARGS='--count REPEATS MAP [METER]'`. MAP is one of `courtyard`, made or
//! repriced for the size and the frame rate to measure at. Without METER: the one that suits the
//! adapter.
//!
//! The camera goes along the tour and back. Runs last ten seconds after two to settle, each after a
//! second of rest; power budgets, error budgets and the best settings alternate, in turn and in
//! reverse, so that savings compare runs of the same minutes. The meter is read by a thread of its
//! own, apart from the plugin's, from step to step of its counter.

use std::fmt::{self, Display, Formatter};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use bevy::asset::Assets;
use bevy::diagnostic::{Diagnostic, DiagnosticsStore};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::math::UVec2;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy_frugal_gi::control::{Budget, PowerController, PowerCorrection, PowerFeedback, Selection};
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::power::{
    MeterChoice, MeterState, PowerMeter, PowerPlugin, PowerSampler, detect, open,
};
use bevy_frugal_gi::units::{Joules, Watts};
use frugal::scene::SceneDescription;
use frugal::stage::{self, Stage, StageOptions, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{median, spread};
use frugal_tests::set;
use frugal_tests::table::markdown;

const SETTLE: Duration = Duration::from_secs(2);
const WINDOW: Duration = Duration::from_secs(10);
const REST: Duration = Duration::from_secs(1);
/// Power budgets, as shares of the range from the cheapest to the best settings' metered power.
const SHARES: [f64; 3] = [0.3, 0.5, 0.7];
/// Error budgets.
const ERRORS: [f64; 2] = [0.01, 0.018];
/// 1 s windows above the budget by more than this share count as over.
const TOLERANCE: f64 = 0.02;

/// What a meter's counter read, and when: one entry for each step.
#[derive(Clone, Default)]
struct Steps(Arc<Mutex<Vec<(Instant, f64)>>>);

impl Steps {
    /// Samples `meter` until `is_over`.
    fn watch(meter: Box<dyn PowerMeter>, is_over: Arc<AtomicBool>) -> Self {
        let steps = Self::default();
        let kept = steps.clone();
        std::thread::spawn(move || {
            let sampler = PowerSampler::fine(meter).unwrap_or_else(|error| panic!("{error}"));
            let mut last = Joules(0.0);
            while !is_over.load(Ordering::Relaxed) {
                let snapshot = sampler.snapshot();
                if let MeterState::Lost { reason } = snapshot.state {
                    panic!("{reason}");
                }
                let (energy, _) = snapshot.counted;
                if energy != last {
                    last = energy;
                    let mut kept = kept.0.lock().unwrap_or_else(PoisonError::into_inner);
                    kept.push((Instant::now(), energy.0));
                }
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        steps
    }

    fn within(&self, from: Instant, to: Instant) -> Vec<(Instant, f64)> {
        let steps = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        steps.iter().filter(|(at, _)| (from..=to).contains(at)).copied().collect()
    }
}

/// Mean power from the first to the last step, watts; NaN for fewer than two.
fn mean(steps: &[(Instant, f64)]) -> f64 {
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else { return f64::NAN };
    (last.1 - first.1) / (last.0 - first.0).as_secs_f64()
}

/// Share of 1 s windows, one from each step, that are over `limit`.
fn over(steps: &[(Instant, f64)], limit: f64) -> f64 {
    let windows: Vec<f64> = steps
        .iter()
        .enumerate()
        .filter_map(|(index, start)| {
            let rest = &steps[index..];
            let end = rest.iter().position(|(at, _)| *at - start.0 >= Duration::from_secs(1))?;
            Some(mean(&rest[..=end]))
        })
        .collect();
    let over = windows.iter().filter(|watts| **watts > limit * (1.0 + TOLERANCE)).count();
    over as f64 / windows.len().max(1) as f64
}

/// What a run plays.
enum Kind {
    /// The cheapest settings.
    Cheapest,
    /// Least error within watts.
    Power(f64),
    /// Least power within an error, by the map alone: a closed loop over errors would add its own
    /// meter's power.
    Error(f64),
    /// The best settings, which savings refer to.
    Best,
}

impl Kind {
    fn budget(&self) -> Budget {
        match *self {
            Self::Cheapest => Budget::power(Watts(0.0)),
            Self::Power(watts) => Budget::power(Watts(watts)),
            Self::Error(error) => Budget::error(error),
            Self::Best => Budget::power(Watts(f64::INFINITY)),
        }
    }
}

impl Display for Kind {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cheapest => write!(formatter, "cheapest settings"),
            Self::Power(watts) => write!(formatter, "{watts:.1} W"),
            Self::Error(error) => write!(formatter, "error {error}"),
            Self::Best => write!(formatter, "best settings"),
        }
    }
}

/// What frames of one run took and chose.
struct Played {
    frames_per_second: f64,
    /// 95th percentile of the time until the GPU has finished a frame, milliseconds.
    slow_frame: f64,
    switches_per_second: f64,
    /// The controller's prediction with the meter's correction, and the map's own.
    predicted: [f64; 2],
    error: f64,
}

/// One run's figures.
struct Run {
    watts: f64,
    over: f64,
    /// Time of a frame's passes on the GPU, milliseconds.
    gpu: f64,
    played: Played,
}

struct Bench {
    stage: Stage,
    scene: SceneDescription,
    camera: Entity,
    steps: Steps,
    interval: Duration,
}

impl Bench {
    /// Renders at the frame rate for `duration`, from the start of the tour.
    fn play(&mut self, duration: Duration) -> Played {
        let path = &self.scene.paths["tour"];
        let (start, length) = (path.start(), path.duration());
        let started = Instant::now();
        let mut next = started;
        let (mut frames, mut switches, mut sums) = (vec![], 0, [0.0; 3]);
        let mut shown = None;
        while started.elapsed() < duration {
            // There and back.
            let phase = (started.elapsed().as_secs_f32() / length).rem_euclid(2.0);
            let time = start + length * (1.0 - (phase - 1.0).abs());
            if let Some(pose) = path.sample(time) {
                self.stage.place(pose.position, pose.rotation);
            }
            let before = Instant::now();
            self.stage.frame();
            frames.push(before.elapsed().as_secs_f64() * 1e3);
            let world = self.stage.world_mut();
            let correction = world.resource::<PowerFeedback>().correction;
            let selection = world.get::<Selection>(self.camera);
            let applied = selection.and_then(|it| it.predicted_applied);
            let settings = selection.map(|it| it.applied);
            switches += u32::from(shown.is_some() && settings != shown);
            shown = settings;
            if let Some(cost) = applied {
                let own = correction.uncorrected(cost.power);
                sums = [sums[0] + cost.power.0, sums[1] + own.0, sums[2] + cost.error];
            }
            next = (next + self.interval).max(Instant::now());
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
        let seconds = started.elapsed().as_secs_f64();
        let means = sums.map(|sum| sum / frames.len() as f64);
        Played {
            frames_per_second: frames.len() as f64 / seconds,
            slow_frame: spread(frames)[1],
            switches_per_second: f64::from(switches) / seconds,
            predicted: [means[0], means[1]],
            error: means[2],
        }
    }

    fn run(&mut self, budget: Budget) -> Run {
        std::thread::sleep(REST);
        let camera = self.camera;
        self.stage.world_mut().entity_mut(camera).insert(budget);
        self.play(SETTLE);
        // Passes that run no more would keep their time.
        let mut diagnostics = self.stage.world_mut().resource_mut::<DiagnosticsStore>();
        diagnostics.iter_mut().for_each(Diagnostic::clear_history);
        let from = Instant::now();
        let played = self.play(WINDOW);
        let steps = self.steps.within(from, Instant::now());
        Run {
            watts: mean(&steps),
            over: over(&steps, budget.power.map_or(f64::INFINITY, |limit| limit.0)),
            gpu: self.gpu_time(),
            played,
        }
    }

    fn correction(&mut self) -> PowerCorrection {
        self.stage.world_mut().resource::<PowerFeedback>().correction
    }

    fn idle(&self) -> f64 {
        std::thread::sleep(SETTLE);
        let from = Instant::now();
        std::thread::sleep(Duration::from_secs(3));
        mean(&self.steps.within(from, Instant::now()))
    }

    /// Time of all passes of a frame on the GPU, milliseconds.
    fn gpu_time(&mut self) -> f64 {
        let passes = self.passes();
        // `fxaa/fxaa` is within `fxaa`.
        let is_within = |name: &str| {
            name.rsplit_once('/').is_some_and(|(parent, _)| passes.iter().any(|it| it.0 == parent))
        };
        passes.iter().filter(|(name, _)| !is_within(name)).map(|(_, ms)| ms).sum()
    }

    /// Time of each pass on the GPU, milliseconds.
    fn passes(&mut self) -> Vec<(String, f64)> {
        let store = self.stage.world_mut().resource::<DiagnosticsStore>();
        let mut passes: Vec<(String, f64)> = store
            .iter()
            .filter_map(|it| {
                let name = it.path().as_str().strip_prefix("render/")?;
                Some((name.strip_suffix("/elapsed_gpu")?.to_owned(), it.average()?))
            })
            .collect();
        passes.sort_by(|a, b| b.1.total_cmp(&a.1));
        passes
    }
}

fn open_bench(map: &Path, meter: Option<&str>) -> Bench {
    let map = frugal_tests::map::read(map);
    let scene = set::scene("courtyard");
    let options = StageOptions {
        size: UVec2::from_array(map.capture.size),
        frames_per_second: map.capture.frames_per_second,
        // The plugin reads the real one.
        meter: Some("none".to_owned()),
        ..Default::default()
    };
    let choice = meter.map_or(MeterChoice::Automatic, |name| MeterChoice::Named(name.to_owned()));
    let mut stage = stage::open_with(&set::loaded(&scene), options, |app| {
        app.add_plugins((
            PowerPlugin { meter: choice, ..Default::default() },
            RenderDiagnosticsPlugin,
        ));
    })
    .unwrap_or_else(|error| panic!("{error}"));
    stage.warm().unwrap_or_else(|error| panic!("{error}"));
    let meter = match meter {
        Some(name) => open(name).unwrap_or_else(|error| panic!("{error}")),
        None => detect(&adapter().expect("an adapter")).unwrap_or_else(|error| panic!("{error}")),
    };
    println!("power by {}: {}", meter.info().name, meter.info().description);
    // Frames take as long as they take.
    stage.world_mut().insert_resource(TimeUpdateStrategy::Automatic);
    let interval = Duration::from_secs_f64(map.capture.frames_per_second.recip());
    let world = stage.world_mut();
    let handle = world.resource_mut::<Assets<FrontierMap>>().add(map);
    let camera = world.query_filtered::<Entity, With<FrugalGi>>().single(world).expect("a camera");
    world.entity_mut(camera).insert(PowerController(handle));
    let steps = Steps::watch(meter, Arc::default());
    Bench { stage, scene, camera, steps, interval }
}

/// Mean, and half the width of its 95 % interval by Student's t.
fn interval(values: &[f64]) -> (f64, f64) {
    /// Two-sided 95 % quantiles for 1, 2, … degrees of freedom.
    const T: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let t = T[(values.len().max(2) - 2).min(T.len() - 1)];
    (mean, t * (variance / count).sqrt())
}

fn main() {
    let arguments = Arguments { size: UVec2::ZERO, samples: 0, count: 5, names: vec![] }.read();
    let Some(map) = arguments.names.first() else {
        println!("metered: name a map: ARGS='MAP [METER]'");
        return;
    };
    if adapter().is_none() {
        println!("no graphics adapter: nothing is measured");
        return;
    }
    let mut bench = open_bench(Path::new(map), arguments.names.get(1).map(String::as_str));
    let before = bench.idle();
    let ends = [Kind::Cheapest, Kind::Best].map(|kind| bench.run(kind.budget()).watts);
    println!("idle {before:.1} W; cheapest settings {:.1} W, best {:.1} W", ends[0], ends[1]);
    let passes: Vec<Vec<String>> = bench
        .passes()
        .into_iter()
        .take(20)
        .map(|(name, ms)| vec![name, format!("{ms:.3}")])
        .collect();
    println!("\n{}\n", markdown(&["pass, at the best settings", "GPU ms"], &passes));
    let kinds: Vec<Kind> = SHARES
        .iter()
        .map(|share| Kind::Power(ends[0] + share * (ends[1] - ends[0])))
        .chain(ERRORS.map(Kind::Error))
        .chain([Kind::Cheapest, Kind::Best])
        .collect();
    let mut runs: Vec<Vec<Run>> = kinds.iter().map(|_| Vec::new()).collect();
    for repeat in 0..arguments.count.max(2) {
        let order: Vec<usize> = (0..kinds.len()).collect();
        let order: Vec<usize> =
            if repeat % 2 == 0 { order } else { order.into_iter().rev().collect() };
        for index in order {
            let run = bench.run(kinds[index].budget());
            let correction = bench.correction();
            let longest: Vec<String> =
                bench.passes().iter().take(4).map(|(pass, ms)| format!("{pass} {ms:.1}")).collect();
            println!(
                "run {repeat}: {}: {:.2} W, {:.0} % of windows over, {:.1} frames/s, {:.1} ms of the GPU ({}), 95 % of frames within {:.1} ms, {:.2} switches/s, predicted {:.1} W, by the map alone {:.1} W, gain {:.2}, offset {:.1}",
                kinds[index],
                run.watts,
                100.0 * run.over,
                run.played.frames_per_second,
                run.gpu,
                longest.join(", "),
                run.played.slow_frame,
                run.played.switches_per_second,
                run.played.predicted[0],
                run.played.predicted[1],
                correction.gain,
                correction.offset
            );
            runs[index].push(run);
        }
    }
    println!("idle afterwards {:.1} W", bench.idle());
    let best: Vec<f64> =
        runs.last().map(|runs| runs.iter().map(|run| run.watts).collect()).unwrap_or_default();
    let rows: Vec<Vec<String>> = kinds
        .iter()
        .zip(&runs)
        .map(|(kind, runs)| {
            let of = |value: fn(&Run) -> f64| runs.iter().map(value).collect::<Vec<_>>();
            let (watts, half) = interval(&of(|run| run.watts));
            let saved: Vec<f64> =
                runs.iter().zip(&best).map(|(run, best)| 1.0 - run.watts / best).collect();
            let (saved, saved_half) = interval(&saved);
            let (used, over) = match kind {
                Kind::Power(limit) => (
                    format!("{:.1} %", 100.0 * watts / limit),
                    format!("{:.1} %", 100.0 * interval(&of(|run| run.over)).0),
                ),
                Kind::Cheapest | Kind::Error(_) | Kind::Best => Default::default(),
            };
            vec![
                kind.to_string(),
                format!("{watts:.2} ± {half:.2} W"),
                used,
                over,
                format!("{:.1} ± {:.1} %", 100.0 * saved, 100.0 * saved_half),
                format!("{:.4}", median(of(|run| run.played.error))),
                format!("{:.1} W", median(of(|run| run.played.predicted[0]))),
                format!("{:.1} W", median(of(|run| run.played.predicted[1]))),
                format!("{:.1}", median(of(|run| run.played.frames_per_second))),
                format!("{:.1} ms", median(of(|run| run.gpu))),
                format!("{:.2} J", median(of(|run| run.watts / run.played.frames_per_second))),
            ]
        })
        .collect();
    let headers = [
        "budget",
        "metered, 95 %",
        "used",
        "1 s windows over",
        "saved of the best's, 95 %",
        "error by the map",
        "predicted",
        "by the map alone",
        "frames/s",
        "GPU",
        "energy a frame",
    ];
    println!("\n{}", markdown(&headers, &rows));
}

//! Writes what the controller does to a CSV file: budgets, predicted and metered power, error,
//! settings and frame times, a few times a second.
//!
//! [`ControlLogPlugin`] writes the file, spreadsheets open it, and `frugal plot-log FILE` plots it.
//! Add it to the builds whose budgets you want to look at.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//! use bevy_frugal_gi_tools::ControlLogPlugin;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins, ControlLogPlugin::new("control.csv")))
//!     .run();
//! ```
//!
//! # The file
//!
//! The first line names the columns; each further line is one camera at one moment. Lines are only
//! appended, so that a crash loses at most the last one. A later run appends to the file, and its
//! clock restarts at 0. An empty field is unknown, or not there.
//!
//! | column | meaning |
//! |---|---|
//! | `time_s` | seconds of real time since the app started |
//! | `camera` | number of the camera in this run, in the order in which cameras appear |
//! | `status` | `waiting`, `met`, `settling`, `power-not-met`, `error-not-met`, `limited-by-power`, or `off` with the reason |
//! | `held_by` | the limit that keeps the settings from being better |
//! | `power_budget_w`, `app_budget_w` | the camera's own limit of power, and that of the whole app, watts |
//! | `predicted_w` | predicted power of the applied settings, corrected by the meter, watts |
//! | `metered_w` | the meter's reading of the whole app, watts, once for every reading |
//! | `meter` | name of the meter, and whether it measures or models |
//! | `error_budget`, `predicted_error` | 1 − SSIM |
//! | `measured_error` | what an [`ErrorMeter`](bevy_frugal_gi::error_meter::ErrorMeter) measured, once for every measurement, 1 − SSIM |
//! | `frame_ms`, `longest_frame_ms` | mean and longest frame since the line before, milliseconds |
//! | `switches` | number of changes of this camera's settings since the line before |
//! | `settings` | every knob with its level |

mod sample;

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Duration;

use bevy::prelude::*;
use bevy_frugal_gi::control::{AppBudget, Budget, Selection, SettingsSwitched};
use bevy_frugal_gi::error_meter::MeasuredError;
use bevy_frugal_gi::knobs::KnobSettings;
use bevy_frugal_gi::power::MeteredPower;
use bevy_frugal_gi::units::Watts;

use crate::row_log::{RowLog, is_on_stage};

pub use sample::ControlSample;
use sample::status;

/// Writes what the controller does to a file: see [the module](self).
///
/// Appends to an existing log, and never changes another existing file. Only one app may write a log
/// at a time. Needs Bevy's `TimePlugin`.
///
/// File errors do not affect the app: frames never wait for the disk, and if the file cannot be
/// written, the log says so once, with the remedy, and ends. In a browser, which has no files, there
/// is none.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlLogPlugin {
    /// Path of the file. Missing parent folders are created.
    pub path: PathBuf,
    /// Interval between samples, in real time. Higher values give a smaller file and coarser curves;
    /// 0 samples every frame. Default: 0.1 s.
    pub interval: Duration,
    /// Maximum number of samples of a run; the log then ends with a warning. Higher values allow
    /// longer runs and larger files. Default: 500,000, about 150 MB, or 14 hours of one camera.
    pub max_samples: usize,
}

impl ControlLogPlugin {
    /// Logs to the file at `path`, with the default settings.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), interval: Duration::from_millis(100), max_samples: 500_000 }
    }
}

impl Plugin for ControlLogPlugin {
    fn build(&self, app: &mut App) {
        // A browser has neither files nor threads.
        if cfg!(target_family = "wasm") {
            warn!("there is no control log: a browser has no files");
            return;
        }
        // The tool decides there.
        if is_on_stage() {
            return;
        }
        let settings = self.clone();
        let start = move |mut commands: Commands| start(&mut commands, &settings);
        // In `Last`: the decisions of this frame, whose settings the next frame shows.
        let sample = sample.run_if(resource_exists::<ControlLog>);
        app.add_systems(Startup, start.run_if(resource_exists::<Time<Real>>))
            .add_systems(Last, sample)
            .add_observer(count_switch);
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Time<Real>>() {
            warn!("ControlLogPlugin stays off: this app has no clock, add TimePlugin");
        }
    }
}

/// The running log.
#[derive(Resource)]
struct ControlLog {
    file: RowLog<ControlSample>,
    interval: Duration,
    next_sample: Duration,
    numbers: HashMap<Entity, u32>,
    switches: HashMap<Entity, u32>,
    /// Numbers of measurements of errors that are logged.
    measured: HashMap<Entity, u32>,
    frames: Frames,
    /// Number of the last logged reading of the meter.
    reading: u64,
}

/// Frames since the last sample.
#[derive(Clone, Copy, Debug, Default)]
struct Frames {
    count: u32,
    seconds: f64,
    longest: f64,
}

impl Frames {
    fn add(&mut self, seconds: f64) {
        self.count += 1;
        self.seconds += seconds;
        self.longest = self.longest.max(seconds);
    }

    /// Mean and longest, milliseconds.
    fn milliseconds(self) -> Option<(f64, f64)> {
        (self.count > 0).then(|| (1e3 * self.seconds / f64::from(self.count), 1e3 * self.longest))
    }
}

/// In `Startup`, and not when plugins are built: an app that never runs changes no file.
fn start(commands: &mut Commands, settings: &ControlLogPlugin) {
    commands.insert_resource(ControlLog {
        file: RowLog::start(&settings.path, settings.max_samples),
        interval: settings.interval,
        next_sample: Duration::ZERO,
        numbers: HashMap::new(),
        switches: HashMap::new(),
        measured: HashMap::new(),
        frames: Frames::default(),
        reading: 0,
    });
}

fn count_switch(switch: On<SettingsSwitched>, log: Option<ResMut<ControlLog>>) {
    if let Some(mut log) = log {
        *log.switches.entry(switch.camera).or_default() += 1;
    }
}

type Cameras<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        &'static Selection,
        Option<&'static Budget>,
        Option<&'static KnobSettings>,
        Option<&'static MeasuredError>,
    ),
>;

fn sample(
    time: Res<Time<Real>>,
    mut log: ResMut<ControlLog>,
    cameras: Cameras<'_, '_>,
    app_budget: Option<Res<AppBudget>>,
    metered: Option<Res<MeteredPower>>,
) {
    let log = &mut *log;
    log.frames.add(time.delta_secs_f64());
    let now = time.elapsed();
    if !log.file.is_running() || now < log.next_sample {
        return;
    }
    log.next_sample = now.saturating_add(log.interval);
    let frames = std::mem::take(&mut log.frames).milliseconds();
    let metered = metered.as_deref();
    let is_new = metered.is_some_and(|metered| metered.sample_count != log.reading);
    log.reading = metered.map_or(log.reading, |metered| metered.sample_count);
    let common = ControlSample {
        // Tenths of a millisecond suffice, and are easier to read.
        time_s: (now.as_secs_f64() * 1e4).round() / 1e4,
        app_budget_w: app_budget.and_then(|budget| limit(budget.power)),
        metered_w: metered
            .filter(|_| is_new)
            .and_then(|metered| metered.latest)
            .and_then(|watts| finite(watts.0)),
        meter: metered.and_then(meter_text).unwrap_or_default(),
        frame_ms: frames.map(|frames| frames.0),
        longest_frame_ms: frames.map(|frames| frames.1),
        ..ControlSample::default()
    };
    for (entity, selection, budget, settings, measured) in &cameras {
        let next = log.numbers.len() as u32;
        let camera = *log.numbers.entry(entity).or_insert(next);
        let predicted = selection.predicted_applied;
        let count = measured.map_or(0, |measured| measured.count);
        let is_measured = log.measured.insert(entity, count).unwrap_or(0) != count;
        let sample = ControlSample {
            camera,
            status: status(selection.status),
            held_by: selection.binding.map(|limit| format!("{limit:?}")).unwrap_or_default(),
            power_budget_w: budget.and_then(|budget| limit(budget.power)),
            predicted_w: predicted.and_then(|cost| finite(cost.power.0)),
            error_budget: budget.and_then(|budget| budget.error).and_then(finite),
            predicted_error: predicted.and_then(|cost| finite(cost.error)),
            measured_error: measured
                .filter(|_| is_measured)
                .and_then(|measured| measured.last)
                .and_then(finite),
            switches: log.switches.remove(&entity).unwrap_or(0),
            settings: settings
                .map(|knobs| one_line(&knobs.space.describe(knobs.settings)))
                .unwrap_or_default(),
            ..common.clone()
        };
        log.file.push(sample);
    }
    log.switches.retain(|camera, _| cameras.contains(*camera));
    log.measured.retain(|camera, _| cameras.contains(*camera));
}

fn finite(number: f64) -> Option<f64> {
    Some(number).filter(|number| number.is_finite())
}

/// A limit in watts; infinity is none.
fn limit(power: Option<Watts>) -> Option<f64> {
    power.and_then(|watts| finite(watts.0))
}

fn meter_text(metered: &MeteredPower) -> Option<String> {
    let info = metered.info.as_ref()?;
    Some(one_line(&format!("{} ({})", info.name, info.provenance)))
}

/// Names of knobs and meters are the app's own, and a row is one line.
fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bevy::time::TimeUpdateStrategy;

    use super::*;
    use crate::row_log::read_rows;
    use crate::testing::{self, changed};
    use bevy_frugal_gi::control::{ControlPlugin, PowerController};
    use bevy_frugal_gi::frontier::{FrontierMap, FrontierMapPlugin};
    use bevy_frugal_gi::power::{MeterInfo, Provenance};

    /// An app of 8 frames a second with a map whose look-ups along −Z find points at 6 W / 0.2, 7 W
    /// / 0.05 and 9 W / 0, and a camera with that view direction.
    fn app(plugin: ControlLogPlugin) -> (App, Entity) {
        let mut app = App::new();
        let plugins = (FrontierMapPlugin, ControlPlugin, plugin);
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), plugins));
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(125)));
        app.finish();
        app.cleanup();
        let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(testing::map());
        let lens = Projection::Perspective(PerspectiveProjection::default());
        let controlled = (PowerController(map), Budget::power(Watts(7.5)));
        let camera = app.world_mut().spawn((Camera::default(), lens, controlled)).id();
        (app, camera)
    }

    fn every_frame(path: PathBuf) -> ControlLogPlugin {
        ControlLogPlugin { interval: Duration::ZERO, ..ControlLogPlugin::new(path) }
    }

    fn read(path: &Path) -> Vec<ControlSample> {
        read_rows(&std::fs::read_to_string(path).expect("a file")).expect("a log")
    }

    #[test]
    fn budgets_switches_and_readings_are_logged() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("control.csv");
        let (mut app, camera) = app(every_frame(path.clone()));
        for _ in 0..4 {
            app.update();
        }
        let info = MeterInfo {
            name: "rapl".into(),
            provenance: Provenance::Measured,
            description: String::new(),
        };
        let metered = changed(MeteredPower::default(), |it| {
            (it.latest, it.sample_count, it.info) = (Some(Watts(8.0)), 1, Some(info));
        });
        app.insert_resource(AppBudget { power: Some(Watts(50.0)) });
        app.world_mut().entity_mut(camera).insert(Budget::both(Watts(6.5), 0.1));
        for _ in 0..12 {
            app.update();
        }
        app.world_mut().entity_mut(camera).insert(MeasuredError { last: Some(0.07), count: 1 });
        // Last, since it corrects predictions.
        app.insert_resource(metered);
        app.update();
        app.update();
        drop(app);

        let samples = read(&path);
        assert_eq!(samples.len(), 18);
        let before = &samples[3];
        assert_eq!((before.status.as_str(), before.power_budget_w), ("met", Some(7.5)));
        assert_eq!((before.predicted_w, before.predicted_error), (Some(7.0), Some(0.05)));
        assert_eq!((before.metered_w, before.meter.as_str()), (None, ""));
        assert_eq!((before.frame_ms, before.longest_frame_ms), (Some(125.0), Some(125.0)));
        let last = &samples[15];
        assert_eq!((last.status.as_str(), last.predicted_w), ("limited-by-power", Some(6.0)));
        assert_eq!((last.error_budget, last.app_budget_w), (Some(0.1), Some(50.0)));
        assert_eq!(last.held_by, "Power");
        assert_eq!((samples[16].metered_w, samples[17].metered_w), (Some(8.0), None));
        assert_eq!(samples[17].meter, "rapl (measured)");
        assert!(last.settings.contains("samples="), "{}", last.settings);
        assert_eq!((samples[16].measured_error, samples[17].measured_error), (Some(0.07), None));
        // One reading is logged once; every switch is counted.
        assert_eq!(samples.iter().filter(|sample| sample.metered_w.is_some()).count(), 1);
        let switches: u32 = samples.iter().map(|sample| sample.switches).sum();
        assert!(switches >= 1, "{switches}");
    }

    #[test]
    fn the_interval_is_kept_and_extreme_numbers_do_not_break_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("control.csv");
        let plugin = ControlLogPlugin {
            interval: Duration::from_millis(500),
            ..ControlLogPlugin::new(&path)
        };
        let (mut app, camera) = app(plugin);
        for power in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300] {
            app.world_mut().entity_mut(camera).insert(Budget::power(Watts(power)));
            app.insert_resource(changed(MeteredPower::default(), |it| {
                (it.latest, it.sample_count) = (Some(Watts(power)), 7);
            }));
            for _ in 0..4 {
                app.update();
            }
        }
        drop(app);
        let samples = read(&path);
        assert_eq!(samples.len(), 5, "20 frames of 125 ms");
        assert_eq!(samples[1].frame_ms, Some(125.0));
        assert!(samples.iter().any(|sample| sample.status == "off InvalidBudget"), "{samples:?}");
    }

    #[test]
    fn a_file_that_cannot_be_written_leaves_the_app_running() {
        let folder = tempfile::tempdir().expect("a folder");
        let other = folder.path().join("other.txt");
        std::fs::write(&other, "something else").expect("a file");
        let (mut app, _) = app(every_frame(other.clone()));
        for _ in 0..200 {
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(!app.world().resource::<ControlLog>().file.is_running());
        drop(app);
        assert_eq!(std::fs::read_to_string(&other).expect("a file"), "something else");
    }
}

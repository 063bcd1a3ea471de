//! `frugal precompute`: a scene's frontier map.

use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy_frugal_gi::frontier::{Bounds, Capture, Correction, FrontierMap, SceneIdentity, Thresholds};
use bevy_frugal_gi::units::Watts;
use indicatif::ProgressBar;

use super::arguments::{CaptureArguments, check_outputs, duration, open_scene, write};
use super::cells::{Clock, measure_cells};
use super::{CliError, progress};
use crate::scene::SceneDescription;
use crate::search::{
    Journal, JournalHeader, Journaled, Monitor as _, SearchConfig, Stage as Step, SubdivisionProgress, Watch, knob_space_hash,
};
use crate::stage::RemoteStage;
use crate::subdivide::{CameraSpace, Statistics, SubdivideConfig, Subdivision, Threshold, subdivide};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Map to write; without it, the scene's name with .pareto.ron, beside the scene
    #[arg(short, long, value_name = "MAP")]
    output: Option<PathBuf>,
    #[command(flatten)]
    capture: CaptureArguments,
    #[command(flatten)]
    search: SearchArguments,
    /// Go on with an interrupted run
    #[arg(long)]
    resume: bool,
}

/// How far and how long the search goes.
#[derive(clap::Args, Debug, Clone)]
pub(super) struct SearchArguments {
    /// Neighbouring frontiers further apart than this are subdivided: watts, or a share of the power range
    #[arg(long, value_name = "W|%", default_value = "10%", value_parser = threshold, allow_hyphen_values = true)]
    pub power_threshold: Threshold,
    /// The same in error (1 − SSIM)
    #[arg(long, value_name = "E", default_value_t = 0.005, allow_hyphen_values = true)]
    pub error_threshold: f64,
    /// How often the camera space may be halved
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub levels: u8,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Ends with the best map so far: 90s, 10m, 1h. The last quarter is for measuring it where it is used
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub time_limit: Option<Duration>,
}

fn threshold(text: &str) -> Result<Threshold, String> {
    let text = text.trim();
    let (number, relative) = match text.strip_suffix('%') {
        Some(number) => (number, true),
        None => (text.strip_suffix(['W', 'w']).unwrap_or(text), false),
    };
    match number.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 && relative => Ok(Threshold::Relative(value / 100.0)),
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(Threshold::Absolute(Watts(value))),
        _ => Err("expected watts or a share, as in 0.5W or 10%".to_owned()),
    }
}

impl SearchArguments {
    pub fn config(&self) -> Result<SubdivideConfig, CliError> {
        if !(self.error_threshold.is_finite() && self.error_threshold >= 0.0) {
            return Err(CliError::usage(format!("--error-threshold {}: must be a finite number, 0 or above", self.error_threshold)));
        }
        if self.levels > 15 {
            return Err(CliError::usage(format!("--levels {}: must be 0 to 15", self.levels)));
        }
        Ok(SubdivideConfig {
            levels: self.levels,
            power_threshold: self.power_threshold,
            error_threshold: self.error_threshold,
            search: SearchConfig { seed: self.seed, ..Default::default() },
            ..Default::default()
        })
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    let output = arguments.output.clone().unwrap_or_else(|| arguments.scene.with_file_name(format!("{name}.pareto.ron")));
    check_outputs([Some(&output)])?;
    arguments.search.config()?;
    let mut stage = open_stage(&scene, &arguments.scene, &arguments.capture)?;
    let journal = journal_path(&output);
    let (map, statistics) = search(&mut stage, &scene, &name, &arguments.search, &journal, arguments.resume)?;
    write(&output, map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_statistics(&statistics, &map);
    // An interrupt may have come after the search.
    if progress::interrupted() {
        return Err(CliError::failed(format!(
            "interrupted: {} holds what was found so far; the same command with --resume goes on",
            output.display()
        )));
    } else if statistics.complete {
        // Nothing is left to resume.
        let _ = std::fs::remove_file(&journal);
    } else {
        eprintln!("time is up: the map is complete as far as it goes; the same command with --resume refines it");
    }
    Ok(())
}

pub(super) fn journal_path(map: &Path) -> PathBuf {
    let mut path = map.as_os_str().to_owned();
    path.push(".journal");
    path.into()
}

/// Stages `scene` with the knobs that were asked for, or with those that it has a use for.
pub(super) fn open_stage(scene: &SceneDescription, path: &Path, capture: &CaptureArguments) -> Result<RemoteStage, CliError> {
    let mut request = capture.request(path);
    if request.knobs.is_none() {
        request.knobs = Some(crate::stage::useful_knobs(scene)?);
    }
    Ok(RemoteStage::open(scene, request)?)
}

/// Searches the scene's camera space, and measures the map where it is used.
pub(super) fn search(
    stage: &mut RemoteStage,
    scene: &SceneDescription,
    name: &str,
    arguments: &SearchArguments,
    journal: &Path,
    resume: bool,
) -> Result<(FrontierMap, Statistics), CliError> {
    let config = arguments.config()?;
    let space = stage.space().clone();
    let bounds = scene.camera_bounds(stage.bounds());
    let identity = SceneIdentity { name: name.to_owned(), fingerprint: scene.fingerprint()? };
    let capture = Capture {
        size: stage.size(),
        frames_per_second: stage.frames_per_second(),
        vertical_fov: scene.camera.vertical_fov,
        exposure_ev100: scene.exposure_ev100,
    };
    let header = JournalHeader {
        scene: identity.fingerprint.clone(),
        knob_space: knob_space_hash(&space).map_err(CliError::failed)?,
        capture: format!("{capture:?}"),
        meter: stage.meter().name,
        seed: arguments.seed,
    };
    let opened = if resume { Journal::resume(journal, &header) } else { Journal::create(journal, &header) };
    let journal = opened.map_err(CliError::usage)?;
    if resume {
        eprintln!("resuming after {} evaluations", journal.len());
    }
    eprintln!("{} knobs, {} combinations; power by {}", space.len(), space.combinations(), stage.meter().description);

    let bar = progress::bar(0);
    let clock = Clock::start(arguments.time_limit);
    let answered = journal.len();
    let mut watch = Watch::start(clock.search(), progress::interrupted, |p: &SubdivisionProgress| show(&bar, p));
    let mut evaluator = Journaled::new(&mut *stage, journal);
    let camera_space = CameraSpace { min: bounds.min, max: bounds.max };
    let found = subdivide(&space, camera_space, &config, &mut evaluator, &mut watch);
    bar.finish_and_clear();
    let Subdivision { octree, statistics } = found.map_err(CliError::failed)?;
    drop(evaluator);
    let asked = (statistics.evaluations + statistics.refinements).saturating_sub(answered);
    let pace = (asked > 0).then(|| watch.seconds() / asked as f64);

    let power_w = match config.power_threshold {
        Threshold::Absolute(watts) => watts.0,
        Threshold::Relative(share) => share * mean_power_range(&octree),
    };
    let mut map = FrontierMap {
        version: FrontierMap::VERSION,
        scene: identity,
        capture,
        meter: stage.meter(),
        thresholds: Thresholds { power_w, error: config.error_threshold },
        seed: arguments.seed,
        knobs: space,
        bounds: Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() },
        octree,
        correction: Correction::default(),
    };
    map.validate().map_err(CliError::failed)?;
    measure_cells(stage, &mut map, arguments.seed, pace, clock)?;
    map.validate().map_err(CliError::failed)?;
    Ok((map, statistics))
}

fn mean_power_range(octree: &bevy_frugal_gi::frontier::Octree) -> f64 {
    let range = |points: &[bevy_frugal_gi::frontier::FrontierPoint]| Some(points.last()?.cost.power.0 - points.first()?.cost.power.0);
    let ranges: Vec<f64> = octree.frontiers.iter().filter_map(|frontier| range(frontier.points())).collect();
    ranges.iter().sum::<f64>() / ranges.len().max(1) as f64
}

fn show(bar: &ProgressBar, progress: &SubdivisionProgress) {
    let step = match progress.stage {
        Step::Searching => "cameras searched",
        Step::Comparing => "nodes compared",
        Step::Settling => "frontiers settled",
    };
    bar.set_length(progress.total as u64);
    bar.set_position(progress.done as u64);
    bar.set_message(format!("{step} at level {}, {} evaluations", progress.level, progress.evaluations));
}

pub(super) fn print_statistics(statistics: &Statistics, map: &FrontierMap) {
    let Statistics { searched, inherited, blind, unfinished, evaluations, cache_hits, refinements, nodes, corners, levels, .. } =
        statistics;
    println!("{searched} cameras searched, {inherited} inherited, {blind} see nothing, {unfinished} left for lack of time");
    println!("{evaluations} evaluations, {cache_hits} known already, {refinements} measured again");
    println!("{nodes} nodes, {corners} corners, {levels} levels, {} frontiers", map.octree.frontiers.len());
    println!(
        "{:.0} s searching, {:.0} s comparing, {:.0} s settling",
        statistics.searching_seconds, statistics.comparing_seconds, statistics.settling_seconds
    );
}

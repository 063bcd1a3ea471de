//! `frugal precompute`: a scene's frontier map.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy_frugal_gi::frontier::{
    Bounds, Capture, FrontierMap, SceneIdentity, Thresholds, WorkPrices,
};
use bevy_frugal_gi::power::MeterInfo;
use bevy_frugal_gi::units::Watts;

use super::arguments::{
    CaptureArguments, check_outputs, duration, open_scene, write, write_report,
};
use super::{CliError, inspect, progress};
use crate::cameras::{CameraMix, CameraSet, TrackSample, recorded, tracks_of};
use crate::cost::FrameLayout;
use crate::journal::{Journal, JournalHeader, hash};
use crate::pipeline::{
    Outcome, PipelineConfig, PipelineError, Progress, Setup, Subject, describe, run as run_pipeline,
};
use crate::report::{Report, SearchSummary, map_section, search_section};
use crate::scene::SceneDescription;
use crate::stage::{RemoteStage, adapter};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Map to write; default: the scene's name with .pareto.ron, beside the scene
    #[arg(short, long, value_name = "MAP")]
    output: Option<PathBuf>,
    #[command(flatten)]
    capture: CaptureArguments,
    #[command(flatten)]
    search: SearchArguments,
    /// Folder for a report on the search and its map
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Resume an interrupted run
    #[arg(long)]
    resume: bool,
}

/// Training cameras, and extent and duration of the search.
#[derive(clap::Args, Debug, Clone)]
pub(super) struct SearchArguments {
    /// Recorded cameras to train on, beside the scene's paths; as the plugin's recorder writes them
    #[arg(long, value_name = "FILE")]
    pub cameras: Vec<PathBuf>,
    /// Paths of the scene to train on; default: all
    #[arg(long = "path", value_name = "NAME")]
    pub paths: Vec<String>,
    /// Training cameras; a sixth as many more calibrate error budgets
    #[arg(long, value_name = "N", default_value_t = 96)]
    pub training: usize,
    /// Power threshold for dividing a node: watts, or a share of the power range
    #[arg(long, value_name = "W|%", default_value = "1%", value_parser = threshold, allow_hyphen_values = true)]
    pub power_threshold: Threshold,
    /// Error threshold for dividing a node (1 − SSIM): a node is divided where either is exceeded
    /// and the division lowers the cost
    #[arg(long, value_name = "E", default_value_t = 0.001, allow_hyphen_values = true)]
    pub error_threshold: f64,
    /// Greatest number of octree levels
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub levels: u8,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Time limit, after which the best map so far is written: 90s, 10m, 1h
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub time_limit: Option<Duration>,
    /// Renders only every N-th job of each batch, beginning with the I-th: 0/4, 1/4, …; frugal
    /// merge joins the journals
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
}

/// Time limit below which a search has fewer pilot cameras and a smaller pool.
const SHORT_SEARCH: Duration = Duration::from_secs(10 * 60);

/// A limit in watts, or as a share of the range of power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Threshold {
    Watts(f64),
    Share(f64),
}

fn threshold(text: &str) -> Result<Threshold, String> {
    let text = text.trim();
    let (number, relative) = match text.strip_suffix('%') {
        Some(number) => (number, true),
        None => (text.strip_suffix(['W', 'w']).unwrap_or(text), false),
    };
    match number.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 && relative => {
            Ok(Threshold::Share(value / 100.0))
        }
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(Threshold::Watts(value)),
        _ => Err("expected watts or a share, as in 0.5W or 10%".to_owned()),
    }
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text
        .split_once('/')
        .and_then(|(index, count)| Some((index.trim().parse().ok()?, count.trim().parse().ok()?)));
    match parts {
        Some((index, count)) if index < count => Ok((index, count)),
        _ => Err("expected a shard's number and how many there are, as in 0/4 to 3/4".to_owned()),
    }
}

impl SearchArguments {
    pub(super) fn check(&self) -> Result<(), CliError> {
        if !(self.error_threshold.is_finite() && self.error_threshold >= 0.0) {
            return Err(CliError::usage(format!(
                "--error-threshold {}: must be a finite number, 0 or above",
                self.error_threshold
            )));
        }
        if self.levels > 6 {
            return Err(CliError::usage(format!("--levels {}: must be 0 to 6", self.levels)));
        }
        if !(1..=100_000).contains(&self.training) {
            return Err(CliError::usage(format!(
                "--training {}: must be 1 to 100000",
                self.training
            )));
        }
        Ok(())
    }

    fn config(&self) -> PipelineConfig {
        let mut config = PipelineConfig { seed: self.seed, ..PipelineConfig::default() };
        if self.time_limit.is_some_and(|limit| limit < SHORT_SEARCH) {
            // Screening alone would take a third of it at three pilots, and a smaller pool leaves time
            // for more cameras.
            (config.pilots, config.pool) = (2, 16);
        }
        config.fit.levels = self.levels;
        config.fit.error_threshold = self.error_threshold;
        match self.power_threshold {
            Threshold::Watts(watts) => config.fit.power_threshold_w = watts,
            Threshold::Share(share) => config.fit.power_threshold_share = share,
        }
        config
    }

    /// Tracks of the scene's paths and of recordings.
    pub(super) fn tracks(
        &self,
        scene: &SceneDescription,
        fps: f64,
    ) -> Result<Vec<Vec<TrackSample>>, CliError> {
        let mut paths = Vec::new();
        for name in &self.paths {
            paths.push(scene.paths.get(name).ok_or_else(|| {
                let known: Vec<_> = scene.paths.keys().map(String::as_str).collect();
                CliError::usage(format!(
                    "{}: no path `{name}`; it has: {}",
                    scene.source.display(),
                    known.join(", ")
                ))
            })?);
        }
        if self.paths.is_empty() {
            paths.extend(scene.paths.values());
        }
        let mut tracks = tracks_of(paths, fps);
        for file in &self.cameras {
            tracks.extend(recorded(file).map_err(CliError::usage)?);
        }
        Ok(tracks)
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    let output = arguments
        .output
        .clone()
        .unwrap_or_else(|| arguments.scene.with_file_name(format!("{name}.pareto.ron")));
    check_outputs([Some(&output)])?;
    arguments.search.check()?;
    let tracks = arguments.search.tracks(&scene, arguments.capture.fps)?;
    let mut stage = open_stage(&scene, &arguments.scene, &arguments.capture)?;
    let journal = journal_path(&output, arguments.search.shard);
    let searched =
        search(&mut stage, &scene, &name, &tracks, &arguments.search, &journal, arguments.resume)?;
    write(&output, searched.map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);
    if let Some(folder) = &arguments.report {
        let mut report = Report::new(&format!("frugal precompute: {name}"));
        report.section(search_section(&searched.summary())?);
        report.section(map_section(&inspect::summary(&searched.map))?);
        write_report(folder, &report.render())?;
    }
    // The run is complete: its journal is not needed.
    let _ = std::fs::remove_file(&journal);
    Ok(())
}

pub(super) fn journal_path(map: &Path, shard: Option<(usize, usize)>) -> PathBuf {
    let mut path = map.as_os_str().to_owned();
    if let Some((index, count)) = shard.filter(|(_, count)| *count > 1) {
        path.push(format!(".{index}-of-{count}"));
    }
    path.push(".journal");
    path.into()
}

/// Stages `scene` with the requested knobs, or with those that affect it.
pub(super) fn open_stage(
    scene: &SceneDescription,
    path: &Path,
    capture: &CaptureArguments,
) -> Result<RemoteStage, CliError> {
    let mut request = capture.request(path);
    if request.knobs.is_none() {
        request.knobs = Some(crate::stage::useful_knobs(scene)?);
    }
    Ok(RemoteStage::open(scene, request)?)
}

/// A map and the outcome of its search.
pub(super) struct Searched {
    pub map: FrontierMap,
    pub outcome: Outcome,
    pub cameras: CameraSet,
}

impl Searched {
    /// For the report.
    pub(super) fn summary(&self) -> SearchSummary<'_> {
        SearchSummary { map: &self.map, outcome: &self.outcome, cameras: &self.cameras }
    }
}

/// Samples cameras and runs the pipeline.
pub(super) fn search(
    stage: &mut RemoteStage,
    scene: &SceneDescription,
    name: &str,
    tracks: &[Vec<TrackSample>],
    arguments: &SearchArguments,
    journal: &Path,
    resume: bool,
) -> Result<Searched, CliError> {
    let config = arguments.config();
    let space = stage.space().clone();
    let bounds = scene.camera_bounds(stage.bounds());
    let lens = stage.lens();
    let counts = [arguments.training, arguments.training.div_ceil(6)];
    let cameras = CameraSet::sample(
        stage.rays(),
        &bounds,
        tracks,
        counts,
        &CameraMix::default(),
        lens,
        arguments.seed,
    );
    let capture = Capture {
        size: stage.size(),
        frames_per_second: stage.frames_per_second(),
        vertical_fov: scene.camera.vertical_fov,
        exposure_ev100: scene.exposure_ev100,
    };
    let identity = SceneIdentity { name: name.to_owned(), fingerprint: scene.fingerprint()? };
    let header = journal_header(&identity, &space, &capture, &stage.meter())?
        .with("seed", arguments.seed)
        .with("cameras", format!("{:016x}", hash(&format!("{cameras:?}"))))
        .with("settings", format!("{config:?} {:?}", arguments.time_limit));
    let journal = open_journal(journal, &header, resume)?;
    eprintln!(
        "{} knobs, {} combinations; {} training and {} calibration cameras; power by {}",
        space.len(),
        space.combinations(),
        cameras.training.len(),
        cameras.calibration.len(),
        stage.meter().description
    );
    // Compiles and loads everything before anything is metered.
    stage.warm()?;

    let layout = FrameLayout::of(scene, stage.size());
    let map_bounds = Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() };
    let bar = progress::bar(0);
    let mut report = |progress: &Progress<'_>| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("renderings, {}", progress.stage));
        if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let setup = Setup {
        measure: stage,
        journal,
        cameras: &cameras,
        clip: (CLIP_FRAMES, capture.frames_per_second),
        shard: arguments.shard.unwrap_or((0, 1)),
        limit: arguments.time_limit,
        report: &mut report,
    };
    let subject = Subject { space: &space, layout: &layout, bounds: &map_bounds, lens };
    let outcome = run_pipeline(&subject, &config, setup);
    bar.finish_and_clear();
    let outcome = outcome.map_err(|error| match error {
        PipelineError::Interrupted => {
            CliError::failed("interrupted: the same command with --resume goes on")
        }
        PipelineError::NoCameras => CliError::usage(format!("{}: {error}", scene.source.display())),
        error => CliError::failed(error),
    })?;
    let map = FrontierMap {
        version: FrontierMap::VERSION,
        scene: identity,
        capture,
        meter: stage.meter(),
        thresholds: Thresholds {
            power_w: outcome.fitted.report.power_threshold_w,
            error: arguments.error_threshold,
        },
        seed: arguments.seed,
        shared: outcome.fitted.shared.rounded(),
        error_rates: outcome.error_rates.clone(),
        work_prices: prices(
            &outcome.cost,
            &space,
            &layout,
            capture.frames_per_second,
            stage.idle(),
        ),
        knobs: space,
        bounds: map_bounds,
        octree: outcome.fitted.octree.clone(),
    };
    map.validate().map_err(CliError::failed)?;
    Ok(Searched { map, outcome, cameras })
}

/// The journal, and the records of an earlier run that is resumed.
fn open_journal(
    path: &Path,
    header: &JournalHeader,
    resume: bool,
) -> Result<(Journal, Vec<String>), CliError> {
    let opened = if resume {
        Journal::resume(path, header)
    } else {
        Journal::create(path, header).map(|journal| (journal, Vec::new()))
    };
    let journal = opened.map_err(CliError::usage)?;
    if resume {
        eprintln!("resuming after {} records", journal.1.len());
    }
    Ok(journal)
}

/// Frames of a clip: one unmetered, and one metered.
///
/// Rejected: four frames. Their history averages more noise, so that settings whose light is noisy
/// have 0.6 to 0.9 of the error of two frames. In play, where the history of 32 frames also blurs
/// and lags, the same settings have 1.25 to 1.4 of the error of four frames at the same poses, and
/// 0.9 to 1.2 of that of two: two are closer, and cost half. Maps from clips of four frames
/// exceeded error budgets by up to a fifth.
const CLIP_FRAMES: u32 = 2;

/// Header of journals of renderings: identifies scene and conditions.
pub(super) fn journal_header(
    scene: &SceneIdentity,
    space: &bevy_frugal_gi::knobs::KnobSpace,
    capture: &Capture,
    meter: &MeterInfo,
) -> Result<JournalHeader, CliError> {
    let knobs = serde_json::to_string(space).map_err(CliError::failed)?;
    let adapter = adapter().map_or_else(|| "none".to_owned(), |adapter| adapter.name);
    Ok(JournalHeader::default()
        .with("scene", &scene.fingerprint)
        .with("knobs", format!("{:016x}", hash(&knobs)))
        .with("capture", format!("{capture:?}"))
        .with("meter", format!("{}: {}", meter.name, meter.description))
        .with("adapter", adapter))
}

/// A model's prices as energy, for a map or a device file. The model's watts include idle power in
/// the price of a frame.
pub(super) fn prices(
    model: &crate::cost::CostModel,
    space: &bevy_frugal_gi::knobs::KnobSpace,
    layout: &FrameLayout,
    frames_per_second: f64,
    idle: Watts,
) -> WorkPrices {
    let kinds = crate::cost::work_names(space);
    let mut joules: Vec<f64> = model.prices.iter().map(|watts| watts / frames_per_second).collect();
    joules.resize(kinds.len(), 0.0);
    // The first kind of work is a frame: its price includes the idle power.
    let idle = idle.0.clamp(0.0, joules.first().copied().unwrap_or(0.0) * frames_per_second);
    if let Some(frame) = joules.first_mut() {
        *frame -= idle / frames_per_second;
    }
    WorkPrices { kinds, joules, idle: Watts(idle), maps: layout.maps, has_sky: layout.has_sky }
}

pub(super) fn print_outcome(searched: &Searched) {
    let Searched { map, outcome, cameras } = searched;
    let (made, seconds) = outcome.effort;
    println!(
        "{} renderings ({made} in this run, {seconds:.0} s) at {} training and {} calibration cameras; a pool of {} settings",
        outcome.renderings,
        outcome.cameras[0],
        outcome.cameras[1],
        outcome.pool.len()
    );
    let wanted = [cameras.training.len(), cameras.calibration.len()];
    if outcome.cameras[0] < wanted[0] || outcome.cameras[1] < wanted[1] {
        println!(
            "the time limit ended the run: {} training and {} calibration cameras were planned; a longer one gives a better map",
            wanted[0], wanted[1]
        );
    }
    println!("{}", describe(&outcome.fitted.report));
    println!(
        "{} nodes, {} corners, {} frontiers",
        map.octree.nodes.len(),
        map.octree.corners.len(),
        map.octree.frontiers.len()
    );
    let quality = outcome.cost_quality;
    println!(
        "power is by the cost model: its error at held-out readings is {:.1} % in the mean, {:.1} % at the 90th percentile",
        100.0 * quality.mean_absolute_error,
        100.0 * quality.ninth_decile
    );
    let fixed: Vec<&str> = outcome
        .screening
        .without_effect
        .iter()
        .map(|knob| map.knobs.knobs()[*knob].name.as_str())
        .collect();
    if !fixed.is_empty() {
        println!(
            "knobs without effect on any image, fixed at their cheapest: {}",
            fixed.join(", ")
        );
    }
    match map.error_rates.0.first() {
        Some(least) => println!(
            "error budgets from {} up are calibrated; the best settings rendered twice differ by {:.4}",
            least.budget, outcome.noise
        ),
        None => println!("no error budget is calibrated: each frame's error is limited instead"),
    }
}

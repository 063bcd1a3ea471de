//! `frugal precompute`: a scene's frontier map.

mod arguments;

use std::path::Path;

use frugal_core::frontier::{Bounds, Capture};
use frugal_search::cameras::{CameraSet, TrackSample};
use frugal_search::journal::hash;
use frugal_search::pipeline::{
    self, CLIP_FRAMES, Extent, PipelineError, Setup, Subject, map_of, run as run_pipeline,
};

use super::CliError;
use super::arguments::{check_outputs, check_report, file_name, write, write_report};
use super::input::{open_scene, stage_for};
use super::journal::{JournalUse, journal_header, journal_path, open_journal, other_journals};
use super::progress::Progress;
use crate::report::{Report, SearchSummary, map_section, search_facts, search_section};
use crate::stage::{RemoteStage, StagedScene};
use crate::subject::{camera_space, frame_layout};
pub(super) use arguments::Arguments;

/// Most calibration cameras. They render the whole pool, beside held-out training cameras.
const MAX_CALIBRATION: usize = 24;

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    // Before an app is built.
    check_report(arguments.report.as_ref())?;
    check_outputs([arguments.output.as_ref()])?;
    let workers = arguments.workers.count(arguments.capture.meter.as_deref())?;
    let recorded = arguments.recorded()?;
    let scene = open_scene(&arguments.scene)?;
    let output = arguments.output.clone().unwrap_or_else(|| {
        let beside = arguments.scene.scene.clone().unwrap_or_default();
        beside.with_file_name(format!("{}.pareto.ron", file_name(&scene.name)))
    });
    check_outputs([Some(&output)])?;
    let mut tracks = arguments.tracks(&scene)?;
    tracks.extend(recorded);
    let request = stage_for(&scene, &arguments.capture);
    let mut stage = RemoteStage::open(&scene, request, workers)?;
    let searched = search(&mut stage, &scene, &tracks, arguments, &output)?;
    write(&output, searched.map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);
    if let Some(folder) = &arguments.report {
        let mut report = Report::new(&format!("frugal precompute: {}", scene.name));
        search_section(&mut report, &searched)
            .and_then(|()| map_section(&mut report, &searched.map))
            .map_err(CliError::failed)?;
        write_report(folder, &report.render())?;
    }
    // The run is complete: its journal is not needed, but other shards read a shard's.
    if arguments.shard.is_none() {
        let _ = std::fs::remove_file(journal_path(&output, None));
    }
    Ok(())
}

/// Samples cameras and runs the pipeline.
fn search(
    stage: &mut RemoteStage,
    scene: &StagedScene,
    tracks: &[Vec<TrackSample>],
    arguments: &Arguments,
    output: &Path,
) -> Result<SearchSummary, CliError> {
    let config = arguments.config();
    let space = stage.space.clone();
    let bounds = camera_space(scene, tracks);
    // A sixth as many for calibration.
    let calibration = arguments.training.div_ceil(6).min(MAX_CALIBRATION);
    let counts = [arguments.training, calibration];
    let cameras =
        CameraSet::sample(&scene.rays, &bounds, tracks, counts, stage.lens, arguments.seed);
    // Before a journal is made and everything warmed in vain.
    if cameras.training.is_empty() {
        return Err(CliError::usage(format!("{}: {}", scene.label, PipelineError::NoCameras)));
    }
    let capture = Capture {
        size: stage.size,
        frames_per_second: arguments.capture.image.fps,
        vertical_fov: scene.camera.vertical_fov,
        exposure_ev100: scene.exposure_ev100,
    };
    let identity = scene.identity()?;
    let limit = arguments.time_limit.map(|limit| format!("{} s", limit.as_secs_f64()));
    let mut paths = arguments.paths.join(",");
    if paths.is_empty() {
        paths = scene.paths.keys().cloned().collect::<Vec<_>>().join(",");
    }
    let none = || "none".to_owned();
    let header = journal_header(&identity, scene.content()?, &capture, &space, &stage.meter)?
        .with("seed", arguments.seed)
        .with("time limit", limit.unwrap_or_else(none))
        .with("number of training cameras", arguments.training)
        .with("number of levels", arguments.levels)
        .with("power threshold", arguments.power_threshold)
        .with("error threshold", arguments.error_threshold)
        .with("list of paths", if paths.is_empty() { none() } else { paths })
        .with("set of cameras", format!("{:016x}", hash(&format!("{cameras:?}"))))
        .with("configuration", format!("{:016x}", hash(&format!("{config:?}"))));
    let file = journal_path(output, arguments.shard);
    let others = other_journals(output, &file);
    let existing = arguments.journal.existing();
    let journal = open_journal(&file, &header, existing, JournalUse::Precompute, &others)?;
    eprintln!(
        "{} knobs, {} combinations; {} training and {} calibration cameras; power by {}",
        space.len(),
        space.combinations(),
        cameras.training.len(),
        cameras.calibration.len(),
        stage.meter.description
    );
    // Compiles and loads everything before anything is metered.
    stage.warm()?;

    let layout = frame_layout(scene, stage.size);
    let map_bounds = Bounds { min: bounds.min.to_array(), max: bounds.max.to_array() };
    let subject = Subject {
        space: &space,
        layout: &layout,
        bounds: &map_bounds,
        lens: stage.lens,
        idle: stage.idle,
    };
    let shown = Progress::new(0, "renderings");
    let mut report = |progress: &pipeline::Progress<'_>| {
        shown.at(progress.done, progress.total, format!("renderings, {}", progress.stage))
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
    let outcome = run_pipeline(&subject, &config, setup);
    drop(shown);
    let outcome = outcome.map_err(|error| JournalUse::Precompute.ended(error))?;
    let map = map_of(&outcome, &subject, &config, identity, capture, stage.meter.clone());
    map.validate().map_err(CliError::failed)?;
    Ok(SearchSummary { map, outcome, cameras })
}

/// Prints the facts of a search, and what a longer one would do better.
fn print_outcome(searched: &SearchSummary) {
    for (name, value) in search_facts(searched) {
        println!("{name:<34} {value}");
    }
    let SearchSummary { outcome, cameras, .. } = searched;
    let wanted = [cameras.training.len(), cameras.calibration.len()];
    if outcome.cameras[0] < wanted[0] || outcome.cameras[1] < wanted[1] {
        println!(
            "the time limit ended the run before all cameras: a longer one gives a better map"
        );
    }
    if outcome.fitted.shared.points().len() < 2 {
        println!(
            "the map has one setting: no knob saves power here. Search with the app's own --size, and with its lights and effects"
        );
    }
    let (extent, whole, (made, seconds)) = (outcome.extent, Extent::WHOLE, outcome.effort);
    if extent != whole && made > 0 {
        let minutes = (seconds / made as f64 * Extent::WHOLE_RENDERINGS as f64 / 60.0).ceil();
        println!(
            "a short search: {} pilot cameras and at most {} settings; with {minutes} minutes it would have {} and {}",
            extent.pilots, extent.pool, whole.pilots, whole.pool
        );
    }
}

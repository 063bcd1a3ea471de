//! One search: cameras, pipeline, and the map of what it found.

use std::cell::LazyCell;
use std::path::PathBuf;

use frugal_core::frontier::{Bounds, Capture, SceneIdentity};
use frugal_search::cameras::{CameraSet, MovingCamera, TrackSample};
use frugal_search::journal::{JournalHeader, hash};
use frugal_search::pipeline::{
    self, CLIP_FRAMES, Extent, PipelineError, Setup, Subject, map_of, run as run_pipeline,
};
use frugal_trace::scene::Bounds as CameraSpace;

use super::super::CliError;
use super::super::journal::{JournalUse, journal_header, open_journal};
use super::super::progress::Progress;
use super::arguments::{Arguments, SearchArguments};
use crate::report::SearchSummary;
use crate::stage::{RemoteError, RemoteStage, StagedScene};
use crate::subject::{camera_space, frame_layout};

/// Most calibration cameras. They render the whole pool, beside held-out training cameras.
const MAX_CALIBRATION: usize = 24;

/// What is searched, and which journal keeps it.
pub(super) struct SearchPlan<'a> {
    pub scene: &'a StagedScene,
    pub tracks: &'a [Vec<TrackSample>],
    pub arguments: &'a Arguments,
    pub journal: PathBuf,
    /// Journals of the same run, which are read.
    pub others: Vec<PathBuf>,
}

impl SearchPlan<'_> {
    fn capture(&self) -> Capture {
        let image = &self.arguments.capture.image;
        Capture {
            size: image.size.to_array(),
            frames_per_second: image.fps,
            vertical_fov: self.scene.camera.vertical_fov,
            exposure_ev100: self.scene.exposure_ev100,
        }
    }

    /// The header of the journal, up to the cameras.
    fn header(
        &self,
        identity: &SceneIdentity,
        stage: &RemoteStage,
    ) -> Result<JournalHeader, CliError> {
        let arguments = &self.arguments.search;
        let limit = arguments.time_limit.map(|limit| format!("{} s", limit.as_secs_f64()));
        let paths = &arguments.tracks.paths;
        let paths = if paths.is_empty() {
            self.scene.paths.keys().cloned().collect::<Vec<_>>().join(",")
        } else {
            paths.join(",")
        };
        let paths = if paths.is_empty() { "none".to_owned() } else { paths };
        Ok(journal_header(identity, &self.capture(), &stage.space, &stage.meter)?
            .with("seed", arguments.seed)
            .with("time limit", limit.unwrap_or_else(|| "none".to_owned()))
            .with("number of training cameras", arguments.training)
            .with("number of levels", arguments.levels)
            .with("power threshold", arguments.power_threshold)
            .with("error threshold", arguments.error_threshold)
            .with("list of paths", paths))
    }
}

/// Samples cameras and runs the pipeline.
pub(super) fn search(
    stage: &mut RemoteStage,
    plan: &SearchPlan<'_>,
) -> Result<SearchSummary, CliError> {
    let SearchPlan { scene, tracks, arguments, .. } = *plan;
    let (existing, search) = (arguments.journal.existing(), &arguments.search);
    let config = search.config();
    let space = stage.space.clone();
    let bounds = camera_space(scene, tracks);
    let cameras = sample_cameras(stage, scene, &bounds, tracks, search);
    let (capture, identity) = (plan.capture(), scene.identity()?);
    let header = plan
        .header(&identity, stage)?
        .with("set of cameras", format!("{:016x}", hash(&format!("{cameras:?}"))))
        .with("configuration", format!("{:016x}", hash(&format!("{config:?}"))));
    let journal =
        open_journal(&plan.journal, &header, existing, JournalUse::Precompute, &plan.others)?;
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
    let lens = stage.lens();
    let idle = stage.idle;
    // Only when the first view is described: on a resumed run it may never be.
    let describer = LazyCell::new(|| scene.view_describer());
    let describe = |camera: &MovingCamera| {
        describer.as_ref().map(|describer| describer.describe(camera)).unwrap_or_default()
    };
    let subject = Subject {
        space: &space,
        layout: &layout,
        bounds: &map_bounds,
        lens,
        idle,
        describe: &describe,
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
        limit: search.time_limit,
        report: &mut report,
    };
    let outcome = run_pipeline(&subject, &config, setup);
    drop(shown);
    let outcome = outcome.map_err(|error| cli_error(error, scene))?;
    let map = map_of(&outcome, &subject, &config, identity, capture, stage.meter.clone());
    map.validate().map_err(CliError::failed)?;
    Ok(SearchSummary { map, outcome, cameras })
}

/// Training cameras, and a sixth as many for calibration, up to [`MAX_CALIBRATION`].
fn sample_cameras(
    stage: &RemoteStage,
    scene: &StagedScene,
    bounds: &CameraSpace,
    tracks: &[Vec<TrackSample>],
    arguments: &SearchArguments,
) -> CameraSet {
    let calibration = arguments.training.div_ceil(6).min(MAX_CALIBRATION);
    let counts = [arguments.training, calibration, Extent::WHOLE.views];
    CameraSet::sample(&scene.rays, bounds, tracks, counts, stage.lens(), arguments.seed)
}

fn cli_error(error: PipelineError<RemoteError>, scene: &StagedScene) -> CliError {
    let of = JournalUse::Precompute;
    match error {
        PipelineError::Interrupted => of.interrupted(),
        PipelineError::Journal(error) => of.failed(&error),
        PipelineError::NeedsOthers => of.needs_others(),
        PipelineError::NoCameras => CliError::usage(format!("{}: {error}", scene.label)),
        error => CliError::failed(error),
    }
}

//! One search: cameras, pipeline, and the map of what it found.

use std::cell::LazyCell;
use std::num::NonZeroUsize;
use std::path::Path;

use bevy_frugal_gi::frontier::{
    Bounds, Capture, FrontierMap, KnobEffects, SceneIdentity, Thresholds, WorkPrices,
};
use bevy_frugal_gi::knobs::KnobSpace;

use super::super::arguments::CaptureArguments;
use super::super::{CliError, progress};
use super::SearchArguments;
use super::journal::{journal_header, open_journal};
use crate::cameras::{CameraMix, CameraSet, MovingCamera, TrackSample};
use crate::cost::FrameLayout;
use crate::journal::hash;
use crate::pipeline::{
    CLIP_FRAMES, Extent, Outcome, PipelineError, Setup, Subject, run as run_pipeline,
};
use crate::report::SearchSummary;
use crate::scene::{self, SceneDescription};
use crate::stage::{RemoteError, RemoteStage};
use crate::view_features::ViewDescriber;

/// Most calibration cameras. They render the whole pool, beside held-out training cameras.
const MOST_CALIBRATION: usize = 24;

/// Stages `scene` with the requested knobs, or with those that affect it.
pub(in crate::cli) fn open_stage(
    scene: &SceneDescription,
    path: &Path,
    capture: &CaptureArguments,
    workers: NonZeroUsize,
) -> Result<RemoteStage, CliError> {
    let mut request = capture.request(path);
    if request.knobs.is_none() {
        request.knobs = Some(crate::stage::useful_knobs(scene)?);
    }
    Ok(RemoteStage::open(scene, request, workers)?)
}

/// A map and the outcome of its search.
pub(in crate::cli) struct Searched {
    pub map: FrontierMap,
    pub outcome: Outcome,
    pub cameras: CameraSet,
}

impl Searched {
    /// For the report.
    pub(in crate::cli) fn summary(&self) -> SearchSummary<'_> {
        SearchSummary { map: &self.map, outcome: &self.outcome, cameras: &self.cameras }
    }
}

/// Samples cameras and runs the pipeline.
pub(in crate::cli) fn search(
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
    let cameras = sample_cameras(stage, &bounds, tracks, arguments);
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
    let lens = stage.lens();
    let idle = stage.idle();
    // Only when the first view is described: on a resumed run it may never be.
    let describer = LazyCell::new(|| ViewDescriber::new(scene));
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
    let bar = progress::bar(0);
    let mut report = progress::of_renderings(&bar);
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
    bar.finish_and_clear();
    let outcome = outcome.map_err(|error| cli_error(error, scene))?;
    let work_prices = prices(&outcome.cost, &space, &layout, capture.frames_per_second);
    let knob_effects = KnobEffects {
        joules: crate::cost::saved_joules(&work_prices, &space, &layout),
        // Six decimals, as the errors of frontiers.
        errors: outcome
            .screening
            .effects
            .iter()
            .map(|levels| levels.iter().map(|error| six_decimals(*error)).collect())
            .collect(),
    };
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
        work_prices,
        knob_effects,
        knobs: space,
        bounds: map_bounds,
        octree: outcome.fitted.octree.clone(),
    };
    map.validate().map_err(CliError::failed)?;
    Ok(Searched { map, outcome, cameras })
}

/// Training cameras, and a sixth as many for calibration, up to [`MOST_CALIBRATION`].
fn sample_cameras(
    stage: &RemoteStage,
    bounds: &scene::Bounds,
    tracks: &[Vec<TrackSample>],
    arguments: &SearchArguments,
) -> CameraSet {
    let calibration = arguments.training.div_ceil(6).min(MOST_CALIBRATION);
    let counts = [arguments.training, calibration, Extent::WHOLE.views];
    let (mix, lens) = (CameraMix::default(), stage.lens());
    CameraSet::sample(stage.rays(), bounds, tracks, counts, &mix, lens, arguments.seed)
}

fn cli_error(error: PipelineError<RemoteError>, scene: &SceneDescription) -> CliError {
    match error {
        PipelineError::Interrupted => {
            CliError::failed("interrupted: the same command with --resume continues")
        }
        PipelineError::NoCameras => CliError::usage(format!("{}: {error}", scene.source.display())),
        error => CliError::failed(error),
    }
}

fn six_decimals(error: f64) -> f64 {
    format!("{error:.6}").parse().unwrap_or(error)
}

/// A model's prices as energy, for a map or a device file.
pub(in crate::cli) fn prices(
    model: &crate::cost::CostModel,
    space: &KnobSpace,
    layout: &FrameLayout,
    frames_per_second: f64,
) -> WorkPrices {
    let kinds = crate::cost::work_names(space);
    let mut joules: Vec<f64> = model.prices.iter().map(|watts| watts / frames_per_second).collect();
    joules.resize(kinds.len(), 0.0);
    let prices = WorkPrices {
        kinds,
        joules,
        idle: model.idle,
        maps: layout.maps,
        point_lights: layout.point_lights,
        has_sky: layout.has_sky,
        ..WorkPrices::default()
    };
    crate::cost::with_shared_knobs(prices, space, layout)
}

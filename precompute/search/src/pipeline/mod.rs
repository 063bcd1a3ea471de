//! From cameras to a map: screening, pool, blocks of cameras, fit, calibration.
//!
//! All renderings go through [`Renderings`] and are journaled, as are proposals, which take seconds.
//! Everything else that follows from renderings is recomputed when a run is resumed. Independent of
//! the renderer: [`Measure`] renders.
mod budgets;
mod clock;
mod extent;
mod finish;
mod map;
mod modelled;
mod pilots;
mod play;
mod renderings;
#[cfg(test)]
mod tests;

use frugal_core::frontier::{Bounds, ErrorRates};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;

use crate::cameras::{CameraSet, MovingCamera};
use crate::cost::{CostModel, FitQuality, FrameLayout};
use crate::fit::{Completion, FitConfig, Fitted};
use crate::journal::JournalError;
use crate::pool::{Proposal, Screening, portfolio, propose, round_seed, screening_settings};
use crate::table::{CostTable, Measure};
use crate::view_features::ViewFeatures;

pub use extent::Extent;
use finish::{Found, finish};
pub use map::map_of;
use modelled::{Modelled, readings};
pub use play::PlayShare;
pub use renderings::{Job, Progress, Purpose, Renderings, Setup, StageEffort};

/// Frames of a clip: one unmetered, and the rest metered. Higher values are closer to play, where
/// history is longer and averages more noise, and cost more.
pub const CLIP_FRAMES: u32 = 4;

/// Share of the time limit after which no new block of cameras starts.
const CAMERAS_SHARE: f64 = 0.97;

/// Configuration of a search. How far it goes follows from its time limit ([`Extent`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PipelineConfig {
    /// Configuration of the fit.
    pub fit: FitConfig,
    /// Seed of every random choice.
    pub seed: u64,
}

/// Why no map was made.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError<E> {
    /// Rendering failed.
    #[error("{0}")]
    Measure(E),
    /// The journal cannot be written.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Interrupted; the renderings are kept.
    #[error("interrupted")]
    Interrupted,
    /// This shard has rendered its share of the batch; other shards have not.
    #[error("this shard's share is rendered, those of others are not")]
    NeedsOthers,
    /// No camera in free space sees any geometry.
    #[error(
        "no camera in free space sees the scene: check its bounds and paths, or record cameras and name them by `--cameras`"
    )]
    NoCameras,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How far the search went.
    pub extent: Extent,
    /// The octree and the shared frontier.
    pub fitted: Fitted,
    /// Exchange rates of error budgets.
    pub error_rates: ErrorRates,
    /// The pool.
    pub pool: Vec<KnobLevels>,
    /// Effects of single knobs.
    pub screening: Screening,
    /// Prices of work, fitted to all readings.
    pub cost: CostModel,
    /// Their cross-validated quality.
    pub cost_quality: FitQuality,
    /// Numbers of training and calibration cameras in the map.
    pub cameras: [usize; 2],
    /// Number of renderings in the journal.
    pub renderings: usize,
    /// Number of renderings made in this run, and their duration in seconds.
    pub effort: (usize, f64),
    /// The same by stage.
    pub stages: Vec<StageEffort>,
    /// Errors in play as a share of those of clips, whose history is shorter.
    pub played: PlayShare,
    /// Mean error of the best settings rendered twice: the noise floor of errors.
    pub noise: f64,
    /// Costs of the pool at the training cameras of the map.
    pub training: CostTable,
    /// Their numbers in the set of cameras, in the order of the table's rows.
    pub training_cameras: Vec<usize>,
}

/// The subject of the search.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The knobs.
    pub space: &'a KnobSpace,
    /// Parameters of the work model other than settings.
    pub layout: &'a FrameLayout,
    /// The octree's root.
    pub bounds: &'a Bounds,
    /// Vertical field of view, radians, and width ÷ height.
    pub lens: (f32, f32),
    /// Power of the idle device, which readings contain.
    pub idle: Watts,
    /// Describes what a camera sees; without features where that is not known.
    pub describe: &'a dyn Fn(&MovingCamera) -> ViewFeatures,
}

/// Runs the pipeline.
///
/// # Errors
/// When rendering fails or is stopped; what was rendered before is in the journal.
pub fn run<M: Measure>(
    subject: &Subject<'_>,
    config: &PipelineConfig,
    setup: Setup<'_, M>,
) -> Result<Outcome, PipelineError<M::Error>> {
    let cameras = setup.cameras;
    if cameras.training.is_empty() {
        return Err(PipelineError::NoCameras);
    }
    let mut renderings = Renderings::new(setup);
    let pilots = pilots::choose(&cameras.training, Extent::WHOLE.pilots);
    let extent = Extent::choose(subject.space, pilots.first().copied(), &mut renderings)?;
    let (pilots, others) = pilots.split_at(extent.pilots.min(pilots.len()));
    let rendered = screening_settings(subject.space, extent.all_levels);
    let screening = screen(subject.space, &rendered, (pilots, others), &mut renderings)?;
    let candidates =
        find_pool(subject, config.seed, &extent, pilots, (&screening, rendered), &mut renderings)?;
    let rendered = render_cameras(subject, &extent, cameras, pilots, &candidates, &mut renderings)?;
    let views = &cameras.unrendered[..extent.views.min(cameras.unrendered.len())];
    let features = view_features(subject, cameras, views, &mut renderings)?;
    let found = Found { extent, cameras, screening, rendered, unrendered: views, features };
    Ok(finish(subject, &config.fit, found, &renderings))
}

/// What training cameras and unrendered views show.
#[derive(Default)]
struct Features {
    training: Vec<ViewFeatures>,
    unrendered: Vec<ViewFeatures>,
}

fn view_features<M: Measure>(
    subject: &Subject<'_>,
    cameras: &CameraSet,
    unrendered: &[MovingCamera],
    renderings: &mut Renderings<'_, M>,
) -> Result<Features, PipelineError<M::Error>> {
    if unrendered.is_empty() {
        return Ok(Features::default());
    }
    let total = cameras.training.len() + unrendered.len();
    let mut of = |purpose: Purpose,
                  cameras: &[MovingCamera],
                  before: usize|
     -> Result<Vec<ViewFeatures>, PipelineError<M::Error>> {
        let mut all = Vec::new();
        for (index, camera) in cameras.iter().enumerate() {
            let progress = Progress { stage: "views", done: before + index, total };
            all.push(
                renderings.features(purpose, index, &progress, || (subject.describe)(camera))?,
            );
        }
        Ok(all)
    };
    Ok(Features {
        training: of(Purpose::Training, &cameras.training, 0)?,
        unrendered: of(Purpose::Unrendered, unrendered, cameras.training.len())?,
    })
}

/// Screening at the pilot cameras. What a knob does may show elsewhere alone: those without effect
/// there are lowered together at `others`, and one by one where that shows.
fn screen<M: Measure>(
    space: &KnobSpace,
    settings: &[KnobLevels],
    (pilots, others): (&[usize], &[usize]),
    renderings: &mut Renderings<'_, M>,
) -> Result<Screening, PipelineError<M::Error>> {
    renderings.batch("screening", &training_jobs(pilots, settings))?;
    let screening = Screening::of(space, &table(renderings, Purpose::Training, pilots, settings));
    if screening.without_effect.is_empty() {
        return Ok(screening);
    }
    let together = screening.fixed(space, space.highest());
    renderings.batch("screening", &training_jobs(others, &[together]))?;
    let shows = |camera: &usize| {
        renderings
            .get(Purpose::Training, *camera, together)
            .is_some_and(|cost| !Screening::is_without_effect(cost.error))
    };
    let where_shown: Vec<usize> = others.iter().copied().filter(shows).collect();
    let one_by_one: Vec<KnobLevels> = screening
        .without_effect
        .iter()
        .map(|knob| space.canonical(space.highest().with_level(*knob, 0)))
        .collect();
    renderings.batch("screening", &training_jobs(&where_shown, &one_by_one))?;
    let cameras = [pilots, &where_shown].concat();
    Ok(Screening::of(space, &table(renderings, Purpose::Training, &cameras, settings)))
}

fn training_jobs(cameras: &[usize], settings: &[KnobLevels]) -> Vec<Job> {
    let job = |camera: &usize| Job {
        purpose: Purpose::Training,
        camera: *camera,
        settings: settings.to_vec(),
    };
    cameras.iter().map(job).collect()
}

/// Rounds of proposals at the pilot cameras. Returns all that they have rendered: the candidates for
/// the pool.
fn find_pool<M: Measure>(
    subject: &Subject<'_>,
    seed: u64,
    extent: &Extent,
    pilots: &[usize],
    (screening, mut rendered): (&Screening, Vec<KnobLevels>),
    renderings: &mut Renderings<'_, M>,
) -> Result<Vec<KnobLevels>, PipelineError<M::Error>> {
    for round in 0..extent.rounds {
        let more = extent.batch * pilots.len();
        let has_time =
            |renderings: &Renderings<'_, M>| renderings.has_time(more, extent.pool_share);
        if !renderings.decide(&format!("round {round}"), has_time)? {
            break;
        }
        let proposed = renderings.settings(&format!("round {round}"), |renderings| {
            let table = table(renderings, Purpose::Training, pilots, &rendered);
            let seed = round_seed(seed, round as u64);
            propose_round(subject, (extent.batch, seed), screening, &table, round)
        })?;
        if proposed.is_empty() {
            break;
        }
        renderings.batch("proposals", &training_jobs(pilots, &proposed))?;
        rendered.extend(proposed);
    }
    Ok(rendered)
}

/// Settings to render next at the pilot cameras; `table`: costs there so far.
fn propose_round(
    subject: &Subject<'_>,
    (count, seed): (usize, u64),
    screening: &Screening,
    table: &CostTable,
    round: usize,
) -> Vec<KnobLevels> {
    let Subject { space, layout, .. } = *subject;
    let cost = CostModel::fit(&readings(subject, table), subject.idle);
    // Alternates between all pilot cameras and each half of them, because the pool must suit
    // different views.
    let halves: [Vec<usize>; 3] =
        [(0..table.rows()).collect(), every_other(table.rows(), 0), every_other(table.rows(), 1)];
    let rows = &halves[round % 3];
    let mean = |column: usize| {
        table.mean(column, rows.iter().copied()).map_or(f64::NAN, |cost| cost.error)
    };
    let errors: Vec<_> = table
        .settings()
        .iter()
        .enumerate()
        .map(|(column, settings)| (*settings, mean(column)))
        .collect();
    let proposal = Proposal { space, screening, cost: &cost, layout, errors: &errors };
    propose(&proposal, count, seed)
}

/// Every other row, starting at `which`; all rows if there is only one.
fn every_other(rows: usize, which: usize) -> Vec<usize> {
    if rows < 2 { (0..rows).collect() } else { (which..rows).step_by(2).collect() }
}

/// What was rendered at cameras.
struct Rendered {
    pool: Vec<KnobLevels>,
    /// Numbers of training and calibration cameras.
    counts: [usize; 2],
    /// Errors in play as a share of those of clips.
    played: PlayShare,
    /// Errors of the settings that a camera has not rendered; `None` where all have all.
    completion: Option<Completion>,
}

/// Renders the pool at blocks of training and calibration cameras, and some of it over stretches of
/// the tracks.
fn render_cameras<M: Measure>(
    subject: &Subject<'_>,
    extent: &Extent,
    cameras: &CameraSet,
    pilots: &[usize],
    candidates: &[KnobLevels],
    renderings: &mut Renderings<'_, M>,
) -> Result<Rendered, PipelineError<M::Error>> {
    let space = subject.space;
    let ends = [space.highest(), space.lowest()].map(|settings| space.canonical(settings));
    let pool = portfolio(
        &Modelled::of(subject, &table(renderings, Purpose::Training, pilots, candidates)).table,
        extent.pool,
        &ends,
    );
    let at_pilots = table(renderings, Purpose::Training, pilots, &pool);
    let played = play::share_of_play(&at_pilots, space, renderings)?;
    // The pilot cameras are already rendered.
    let order: Vec<usize> = pilots
        .iter()
        .copied()
        .chain((0..cameras.training.len()).filter(|camera| !pilots.contains(camera)))
        .collect();
    let mut counts = [pilots.len().min(order.len()), 0];
    let mut completion = None;
    while counts[0] < order.len() || counts[1] < cameras.calibration.len() {
        let training = &order[counts[0]..(counts[0] + extent.block).min(order.len())];
        // A sixth as many, and the rest at the end.
        let due = (counts[0] + training.len()) / 6;
        let due = if training.is_empty() { counts[1] + extent.block } else { due };
        let calibration = counts[1]..due.clamp(counts[1], cameras.calibration.len());
        if completion.is_none() && counts[0] >= extent.full {
            let full = table(renderings, Purpose::Training, &order[..counts[0]], &pool);
            completion = Completion::fit(space, &full, &pool, extent.anchors);
        }
        let anchors = completion.as_ref().map_or_else(|| pool.clone(), Completion::anchors);
        let job = |purpose: Purpose, camera: usize, settings: &Vec<KnobLevels>| Job {
            purpose,
            camera,
            settings: settings.clone(),
        };
        let mut jobs: Vec<Job> =
            training.iter().map(|camera| job(Purpose::Training, *camera, &anchors)).collect();
        jobs.extend(calibration.clone().map(|camera| job(Purpose::Calibration, camera, &pool)));
        // Plus the reference image at each camera.
        let more = jobs.iter().map(|job| job.settings.len() + 2).sum();
        let name = format!("block {} {}", counts[0], counts[1]);
        if !renderings.decide(&name, |renderings| renderings.has_time(more, CAMERAS_SHARE))? {
            break;
        }
        renderings.batch("cameras", &jobs)?;
        counts = [counts[0] + training.len(), calibration.end];
    }
    Ok(Rendered { pool, counts, played, completion })
}

fn table<M: Measure>(
    renderings: &Renderings<'_, M>,
    purpose: Purpose,
    cameras: &[usize],
    settings: &[KnobLevels],
) -> CostTable {
    let mut table = CostTable::new(cameras.len());
    for (row, camera) in cameras.iter().enumerate() {
        for settings in settings {
            if let Some(cost) = renderings.get(purpose, *camera, *settings) {
                table.set(row, *settings, cost);
            }
        }
    }
    table
}

//! From cameras to a map: screening, pool, blocks of cameras, fit, calibration.
//!
//! All renderings go through `Renderings` and are journaled, as are proposals, which take seconds.
//! Everything else that follows from renderings is recomputed when a run is resumed. Independent of
//! the renderer: [`Measure`](crate::table::Measure) renders.
mod clock;
mod extent;
mod finish;
mod pilots;
mod renderings;
#[cfg(test)]
mod tests;

use frugal_core::frontier::{Bounds, ErrorRates};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;

use crate::cameras::CameraSet;
use crate::cost::{CostModel, FrameLayout, Work};
use crate::fit::{Completion, FitConfig, Fitted};
use crate::journal::JournalError;
use crate::pool::{Screening, portfolio, propose, screening_settings};
use crate::table::CostTable;

pub use extent::Extent;
pub use finish::map_of;
use finish::{finish, modelled, readings};
use renderings::{Job, Purpose, Renderings};
pub use renderings::{Progress, Setup};

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
pub enum PipelineError {
    /// Rendering failed: why, in a sentence.
    #[error("{0}")]
    Measure(String),
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
    /// Mean relative error of power at held-out readings.
    pub cost_error: f64,
    /// Numbers of training and calibration cameras in the map.
    pub cameras: [usize; 2],
    /// Number of renderings in the journal.
    pub renderings: usize,
    /// Number of renderings made in this run, and their duration in seconds.
    pub effort: (usize, f64),
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
}

/// Runs the pipeline.
///
/// # Errors
/// When rendering fails or is stopped; what was rendered before is in the journal.
pub fn run(
    subject: &Subject<'_>,
    config: &PipelineConfig,
    setup: Setup<'_>,
) -> Result<Outcome, PipelineError> {
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
    Ok(finish(subject, &config.fit, cameras, (extent, screening, rendered), &renderings))
}

/// Screening at the pilot cameras. What a knob does may show elsewhere alone: those without effect
/// there are lowered together at `others`, and one by one where that shows.
fn screen(
    space: &KnobSpace,
    settings: &[KnobLevels],
    (pilots, others): (&[usize], &[usize]),
    renderings: &mut Renderings<'_>,
) -> Result<Screening, PipelineError> {
    renderings.batch("screening", &jobs(Purpose::Training, pilots, settings))?;
    let screening = Screening::of(space, &table(renderings, Purpose::Training, pilots, settings));
    if screening.without_effect.is_empty() {
        return Ok(screening);
    }
    let together = screening.fixed(space, space.highest());
    renderings.batch("screening", &jobs(Purpose::Training, others, &[together]))?;
    let shows = |camera: &usize| {
        renderings
            .get((Purpose::Training, *camera), together)
            .is_some_and(|cost| !Screening::is_without_effect(cost.error))
    };
    let where_shown: Vec<usize> = others.iter().copied().filter(shows).collect();
    let one_by_one: Vec<KnobLevels> = screening
        .without_effect
        .iter()
        .map(|knob| space.canonical(space.highest().with_level(*knob, 0)))
        .collect();
    renderings.batch("screening", &jobs(Purpose::Training, &where_shown, &one_by_one))?;
    let cameras = [pilots, &where_shown].concat();
    Ok(Screening::of(space, &table(renderings, Purpose::Training, &cameras, settings)))
}

/// `settings` at each of `cameras`.
fn jobs(purpose: Purpose, cameras: &[usize], settings: &[KnobLevels]) -> Vec<Job> {
    let job = |camera: &usize| Job { camera: (purpose, *camera), settings: settings.to_vec() };
    cameras.iter().map(job).collect()
}

/// Rounds of proposals at the pilot cameras. Returns all that they have rendered: the candidates for
/// the pool.
fn find_pool(
    subject: &Subject<'_>,
    seed: u64,
    extent: &Extent,
    pilots: &[usize],
    (screening, mut rendered): (&Screening, Vec<KnobLevels>),
    renderings: &mut Renderings<'_>,
) -> Result<Vec<KnobLevels>, PipelineError> {
    for round in 0..extent.rounds {
        let name = format!("round {round}");
        if !renderings.has_time(&name, extent.batch * pilots.len(), extent.pool_share)? {
            break;
        }
        let proposed = renderings.settings(&name, |renderings| {
            let table = table(renderings, Purpose::Training, pilots, &rendered);
            let cost = CostModel::fit(&readings(subject, &table), subject.idle);
            // Alternates between all pilot cameras and each half of them, because the pool must suit
            // different views.
            let (first, step) = match round % 3 {
                half @ 1.. if table.rows() > 1 => (half - 1, 2),
                _ => (0, 1),
            };
            let error = |column: usize| {
                let rows = (first..table.rows()).step_by(step);
                table.mean(column, rows).map_or(f64::NAN, |cost| cost.error)
            };
            let columns = table.settings().iter().enumerate();
            let errors: Vec<_> =
                columns.map(|(column, settings)| (*settings, error(column))).collect();
            let Subject { space, layout, .. } = *subject;
            let power = |settings| cost.power(&Work::of(space, settings, layout));
            // Another seed in every round.
            let seed = seed.wrapping_mul(1000).wrapping_add(round as u64);
            propose(space, screening, &power, &errors, (extent.batch, seed))
        })?;
        if proposed.is_empty() {
            break;
        }
        renderings.batch("proposals", &jobs(Purpose::Training, pilots, &proposed))?;
        rendered.extend(proposed);
    }
    Ok(rendered)
}

/// What was rendered at cameras.
struct Rendered {
    pool: Vec<KnobLevels>,
    /// Numbers of training and calibration cameras.
    counts: [usize; 2],
    /// Errors of the settings that a camera has not rendered; `None` where all have all.
    completion: Option<Completion>,
}

/// Renders the pool at blocks of training and calibration cameras.
fn render_cameras(
    subject: &Subject<'_>,
    extent: &Extent,
    cameras: &CameraSet,
    pilots: &[usize],
    candidates: &[KnobLevels],
    renderings: &mut Renderings<'_>,
) -> Result<Rendered, PipelineError> {
    let space = subject.space;
    let ends = [space.highest(), space.lowest()].map(|settings| space.canonical(settings));
    let at_pilots = table(renderings, Purpose::Training, pilots, candidates);
    let pool = portfolio(&modelled(subject, &at_pilots, None).0, extent.pool, &ends);
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
        let calibration: Vec<usize> =
            (counts[1]..due.clamp(counts[1], cameras.calibration.len())).collect();
        if completion.is_none() && counts[0] >= extent.full {
            let full = table(renderings, Purpose::Training, &order[..counts[0]], &pool);
            completion = Completion::fit(space, &full, &pool, extent.anchors);
        }
        let anchors = completion.as_ref().map_or_else(|| pool.clone(), Completion::anchors);
        let mut batch = jobs(Purpose::Training, training, &anchors);
        batch.extend(jobs(Purpose::Calibration, &calibration, &pool));
        // Plus the reference image at each camera.
        let more = batch.iter().map(|job| job.settings.len() + 2).sum();
        let name = format!("block {} {}", counts[0], counts[1]);
        if !renderings.has_time(&name, more, CAMERAS_SHARE)? {
            break;
        }
        renderings.batch("cameras", &batch)?;
        counts = [counts[0] + training.len(), counts[1] + calibration.len()];
    }
    Ok(Rendered { pool, counts, completion })
}

fn table(
    renderings: &Renderings<'_>,
    purpose: Purpose,
    cameras: &[usize],
    settings: &[KnobLevels],
) -> CostTable {
    let mut table = CostTable::new(cameras.len());
    for (row, camera) in cameras.iter().enumerate() {
        for settings in settings {
            if let Some(cost) = renderings.get((purpose, *camera), *settings) {
                table.set(row, *settings, cost);
            }
        }
    }
    table
}

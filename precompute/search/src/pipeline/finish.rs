//! The end of a search: power by the fitted model, the fit, calibration, the map.

use frugal_core::frontier::{
    CameraView, Capture, CostPoint, ErrorRates, FrontierMap, KnobEffects, SceneIdentity,
    Thresholds, look_up_in,
};
use frugal_core::power::MeterInfo;

use super::{Extent, Outcome, PipelineConfig, Purpose, Rendered, Renderings, Subject, table};
use crate::cameras::{CameraSet, MovingCamera, view_from};
use crate::cost::{CostModel, CostReading, Work, saved_joules, work_prices};
use crate::fit::{Calibration, Completion, FitConfig, Fitted, Training, calibrate, fit};
use crate::pool::Screening;
use crate::table::CostTable;

/// Cameras of tracks that are enough to calibrate by them alone.
const ENOUGH_ON_TRACKS: usize = 20;

/// Fits the octree and calibrates error budgets.
pub(super) fn finish(
    subject: &Subject<'_>,
    config: &FitConfig,
    cameras: &CameraSet,
    (extent, screening, rendered): (Extent, Screening, Rendered),
    renderings: &Renderings<'_>,
) -> Outcome {
    let Rendered { pool, counts, completion } = rendered;
    let table = |purpose: Purpose, count: usize| {
        table(renderings, purpose, &(0..count).collect::<Vec<_>>(), &pool)
    };
    let rendered = table(Purpose::Training, cameras.training.len());
    let (costs, cost) = modelled(subject, &rendered, completion.as_ref());
    let calibration = table(Purpose::Calibration, counts[1]);
    let (training, rows) = Training::new(&costs, &cameras.training, &pool);
    let view = |row: &usize| view_from(&cameras.training[*row].pose, subject.lens);
    let views: Vec<CameraView> = rows.iter().map(view).collect();
    let fitted = fit(&training, &views, subject.bounds, config);
    let is_full = |row: usize| pool.iter().all(|one| rendered.get(row, *one).is_some());
    let evidence = (&costs, &rows[..], &is_full as &dyn Fn(usize) -> bool, &calibration);
    let error_rates = calibrated(subject, cameras, &fitted, evidence);
    let best = subject.space.canonical(subject.space.highest());
    let readings = readings(subject, &rendered);
    Outcome {
        extent,
        error_rates,
        pool,
        screening,
        cost_error: CostModel::cross_validated(&readings, subject.idle),
        cost,
        cameras: [rows.len(), counts[1]],
        renderings: renderings.known.len(),
        effort: (renderings.clock.made, renderings.clock.seconds),
        training: costs.with_rows(&rows),
        training_cameras: rows,
        noise: rendered.known_mean_error(best).unwrap_or(0.0),
        fitted,
    }
}

/// A camera by which error budgets are calibrated.
struct Judge<'a> {
    camera: MovingCamera,
    /// Its frontier by cameras without it, and its errors.
    calibration: Calibration<'a>,
    /// Whether it has rendered the whole pool.
    is_full: bool,
}

/// Calibrates error budgets: by cameras of tracks where there are enough, since these are the views
/// that users play, and by all else.
///
/// Where there are enough, only cameras that have rendered the whole pool take part: completed errors
/// share the prediction's bias.
///
/// `evidence`: costs at the training cameras, the rows there of those in the fit, whether one has rendered
/// the whole pool, and costs at the calibration cameras.
fn calibrated(
    subject: &Subject<'_>,
    cameras: &CameraSet,
    fitted: &Fitted,
    (costs, rows, is_full, calibration): (&CostTable, &[usize], &dyn Fn(usize) -> bool, &CostTable),
) -> ErrorRates {
    let apart = (0..calibration.rows()).filter_map(|row| {
        let camera = cameras.calibration[row];
        let view = view_from(&camera.pose, subject.lens);
        let frontier = look_up_in(&fitted.octree, subject.bounds, &view)?.frontier;
        let calibration = Calibration { frontier, table: calibration, row };
        Some(Judge { camera, calibration, is_full: true })
    });
    let crossed = fitted.held_out.iter().zip(rows).map(|(frontier, row)| Judge {
        camera: cameras.training[*row],
        calibration: Calibration { frontier, table: costs, row: *row },
        is_full: is_full(*row),
    });
    let mut all: Vec<Judge<'_>> =
        apart.chain(crossed).filter(|judge| !judge.calibration.frontier.is_empty()).collect();
    let on_track = |judge: &Judge<'_>| judge.camera.is_on_track();
    if all.iter().filter(|judge| judge.is_full && on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(|judge| judge.is_full);
    }
    if all.iter().filter(|judge| on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(on_track);
    }
    // Groups are numbered along tracks.
    all.sort_by_key(|judge| judge.camera.group);
    let cameras: Vec<Calibration<'_>> = all.iter().map(|judge| judge.calibration).collect();
    calibrate(&cameras)
}

/// The readings of a table, with the work of their settings.
pub(super) fn readings(subject: &Subject<'_>, table: &CostTable) -> Vec<CostReading> {
    let columns = table.settings().iter().enumerate();
    let of = columns.flat_map(|(column, settings)| {
        let work = Work::of(subject.space, *settings, subject.layout);
        table.known(column).map(move |(row, cost)| CostReading {
            camera: row,
            work: work.clone(),
            power_w: cost.power.0,
        })
    });
    of.collect()
}

/// Prior weight, in readings, of a deviation of 0 of a setting from the model.
const SETTING_PRIOR: f64 = 3.0;

/// `table` with power from the fitted model in place of single readings: price of the work × the camera's
/// factor × the mean deviation of the setting's readings. Errors are unchanged; `completion` adds those
/// of settings that a camera has not rendered. Returns the model, too.
pub(super) fn modelled(
    subject: &Subject<'_>,
    table: &CostTable,
    completion: Option<&Completion>,
) -> (CostTable, CostModel) {
    let model = CostModel::fit(&readings(subject, table), subject.idle);
    let (mut modelled, mut deviations) = (CostTable::new(table.rows()), Vec::new());
    for (column, settings) in table.settings().iter().enumerate() {
        let work = Work::of(subject.space, *settings, subject.layout);
        let beyond: Vec<f64> = table
            .known(column)
            .map(|(row, cost)| (cost.power.0 / model.power_at(row, &work)).ln())
            .filter(|ln| ln.is_finite())
            .collect();
        let deviation = (beyond.iter().sum::<f64>() / (beyond.len() as f64 + SETTING_PRIOR)).exp();
        deviations.push(deviation);
        for (row, cost) in table.known(column) {
            let power = model.power_at(row, &work) * deviation;
            modelled.set(row, *settings, CostPoint::new(power, cost.error));
        }
    }
    let Some(completion) = completion else { return (modelled, model) };
    let complete = completion.complete(&modelled, |row, settings| {
        let work = Work::of(subject.space, settings, subject.layout);
        let deviation = table.column(settings).map_or(1.0, |column| deviations[column]);
        model.power_at(row, &work) * deviation
    });
    (complete, model)
}

/// The map of what `config`'s search of `subject` found.
pub fn map_of(
    outcome: &Outcome,
    subject: &Subject<'_>,
    config: &PipelineConfig,
    scene: SceneIdentity,
    capture: Capture,
    meter: MeterInfo,
) -> FrontierMap {
    let Subject { space, layout, bounds, .. } = *subject;
    let work_prices = work_prices(&outcome.cost, space, layout, capture.frames_per_second);
    let effects = outcome.screening.effects.iter();
    let knob_effects = KnobEffects {
        joules: saved_joules(&work_prices, space, layout),
        errors: effects.map(|levels| levels.iter().copied().map(six_decimals).collect()).collect(),
    };
    FrontierMap {
        version: FrontierMap::VERSION,
        scene,
        capture,
        meter,
        thresholds: Thresholds {
            power_w: outcome.fitted.report.power_threshold_w,
            error: config.fit.error_threshold,
        },
        seed: config.seed,
        shared: outcome.fitted.shared.rounded(),
        error_rates: outcome.error_rates.clone(),
        work_prices,
        knob_effects,
        knobs: space.clone(),
        bounds: *bounds,
        octree: outcome.fitted.octree.clone(),
    }
}

/// As the errors of frontiers.
fn six_decimals(error: f64) -> f64 {
    format!("{error:.6}").parse().unwrap_or(error)
}

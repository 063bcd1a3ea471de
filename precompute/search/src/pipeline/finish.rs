//! The end of a search: costs as in play, the fit, calibration, the map.

use frugal_core::frontier::{
    CameraView, Capture, FrontierMap, KnobEffects, SceneIdentity, Thresholds,
};
use frugal_core::power::MeterInfo;

use super::budgets::calibrated;
use super::modelled::{Modelled, readings};
use super::{Extent, Outcome, PipelineConfig, Purpose, Rendered, Renderings, Subject, table};
use crate::cameras::{CameraSet, MovingCamera, view_from};
use crate::cost::{CostModel, saved_joules, work_prices};
use crate::fit::{DescribedView, FitConfig, Training, fit};
use crate::pool::Screening;
use crate::table::{CostTable, Measure};
use crate::view_features::ViewFeatures;

/// Costs of the pool.
pub(super) struct Costs {
    /// At all training cameras, as rendered.
    pub rendered: CostTable,
    /// The same with power by the model, and with all errors, as in play.
    pub training: CostTable,
    /// At the calibration cameras, errors as in play.
    pub calibration: CostTable,
    model: CostModel,
}

impl Costs {
    fn of<M: Measure>(
        subject: &Subject<'_>,
        cameras: &CameraSet,
        Rendered { pool, counts, played, completion }: &Rendered,
        renderings: &Renderings<'_, M>,
    ) -> Self {
        let table = |purpose: Purpose, count: usize| {
            table(renderings, purpose, &(0..count).collect::<Vec<_>>(), pool)
        };
        let rendered = table(Purpose::Training, cameras.training.len());
        let calibration = table(Purpose::Calibration, counts[1]);
        let modelled = Modelled::of(subject, &rendered);
        let Modelled { table: clips, model, .. } = match completion {
            Some(completion) => modelled.completed(subject, completion),
            None => modelled,
        };
        let training = played.apply(&clips, &clips);
        let calibration = played.apply(&calibration, &training);
        Self { rendered, training, calibration, model }
    }
}

/// Fits the octree and calibrates error budgets. `unrendered`: views that no camera has rendered;
/// `features`: what training cameras and those views show.
pub(super) fn finish<M: Measure>(
    subject: &Subject<'_>,
    config: &FitConfig,
    cameras: &CameraSet,
    (extent, screening, rendered): (Extent, Screening, Rendered),
    (unrendered, features): (&[MovingCamera], [Vec<ViewFeatures>; 2]),
    renderings: &Renderings<'_, M>,
) -> Outcome {
    let costs = Costs::of(subject, cameras, &rendered, renderings);
    let Rendered { pool, counts, played, .. } = rendered;
    let (training, rows) = Training::new(&costs.training, &cameras.training, &pool);
    let used: Vec<MovingCamera> = rows.iter().map(|row| cameras.training[*row]).collect();
    let views_of = |cameras: &[MovingCamera]| -> Vec<CameraView> {
        cameras.iter().map(|camera| view_from(&camera.pose, subject.lens)).collect()
    };
    let (mut views, beyond) = (views_of(&used), views_of(unrendered));
    let [of_training, of_unrendered] = &features;
    let of_training = rows.iter().filter_map(|row| of_training.get(*row));
    let training =
        training.with_unrendered(described(&views, of_training), described(&beyond, of_unrendered));
    views.extend(beyond);
    let fitted = fit(&training, &views, subject.bounds, config);
    let error_rates = calibrated(subject, cameras, &fitted, (&costs, &rows, &pool), &played);
    let best = subject.space.canonical(subject.space.highest());
    let readings = readings(subject, &costs.rendered);
    Outcome {
        extent,
        error_rates,
        pool,
        screening,
        cost_error: CostModel::cross_validated(&readings, subject.idle, 5),
        cost: costs.model,
        cameras: [used.len(), counts[1]],
        renderings: renderings.count(),
        effort: (renderings.clock.made, renderings.clock.seconds),
        training: costs.training.with_rows(&rows),
        training_cameras: rows,
        played,
        noise: costs.rendered.known_mean_error(best).unwrap_or(0.0),
        fitted,
    }
}

fn described<'a>(
    views: &[CameraView],
    features: impl IntoIterator<Item = &'a ViewFeatures>,
) -> Vec<DescribedView> {
    let pairs = views.iter().zip(features);
    let described = |(view, features): (&CameraView, &ViewFeatures)| DescribedView {
        viewpoint: view.into(),
        features: features.clone(),
    };
    pairs.map(described).collect()
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

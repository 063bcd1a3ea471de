//! The end of a search: costs as in play, the fit, calibration.

use frugal_core::frontier::CameraView;

use super::budgets::{Evidence, calibrated, views};
use super::modelled::{Modelled, readings};
use super::{Extent, Features, Outcome, Purpose, Rendered, Renderings, Subject, table};
use crate::cameras::{CameraSet, MovingCamera};
use crate::cost::CostModel;
use crate::fit::{DescribedView, FitConfig, Training, fit};
use crate::pool::Screening;
use crate::table::{CostTable, Measure};
use crate::view_features::ViewFeatures;

/// What a search found.
pub(super) struct Found<'a> {
    pub extent: Extent,
    pub cameras: &'a CameraSet,
    pub screening: Screening,
    pub rendered: Rendered,
    /// Views that no camera has rendered.
    pub unrendered: &'a [MovingCamera],
    pub features: Features,
}

/// Costs of the pool.
struct Costs {
    /// At all training cameras, as rendered.
    rendered: CostTable,
    /// The same with power by the model, and with all errors, as in play.
    training: CostTable,
    /// At the calibration cameras, errors as in play.
    calibration: CostTable,
    model: CostModel,
}

impl Costs {
    fn of<M: Measure>(
        subject: &Subject<'_>,
        found: &Found<'_>,
        renderings: &Renderings<'_, M>,
    ) -> Self {
        let Rendered { pool, counts, played, completion } = &found.rendered;
        let table = |purpose: Purpose, count: usize| {
            table(renderings, purpose, &(0..count).collect::<Vec<_>>(), pool)
        };
        let rendered = table(Purpose::Training, found.cameras.training.len());
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

/// Fits the octree and calibrates error budgets.
pub(super) fn finish<M: Measure>(
    subject: &Subject<'_>,
    config: &FitConfig,
    found: Found<'_>,
    renderings: &Renderings<'_, M>,
) -> Outcome {
    let costs = Costs::of(subject, &found, renderings);
    let Found { extent, cameras, screening, rendered, unrendered, features } = found;
    let Rendered { pool, counts, played, .. } = rendered;
    let (training, rows) = Training::new(&costs.training, &cameras.training, &pool);
    let used: Vec<MovingCamera> = rows.iter().map(|row| cameras.training[*row]).collect();
    let (mut views, beyond) = (views(&used, subject.lens), views(unrendered, subject.lens));
    let of_training = rows.iter().filter_map(|row| features.training.get(*row));
    let training = training
        .with_unrendered(described(&views, of_training), described(&beyond, &features.unrendered));
    views.extend(beyond);
    let fitted = fit(&training, &views, subject.bounds, config);
    let is_full = |row: usize| pool.iter().all(|one| costs.rendered.get(row, *one).is_some());
    let evidence = Evidence {
        training: &costs.training,
        rows: &rows,
        is_full: &is_full,
        calibration: &costs.calibration,
    };
    let error_rates = calibrated(subject, cameras, &fitted, &evidence, &played);
    let best = subject.space.canonical(subject.space.highest());
    let readings = readings(subject, &costs.rendered);
    Outcome {
        extent,
        error_rates,
        pool,
        screening,
        cost_quality: CostModel::cross_validated(&readings, subject.idle, 5),
        cost: costs.model,
        cameras: [used.len(), counts[1]],
        renderings: renderings.count(),
        effort: renderings.effort(),
        stages: renderings.stages().to_vec(),
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

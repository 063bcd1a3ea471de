//! The map of a finished search.

use frugal_core::frontier::{Capture, FrontierMap, KnobEffects, SceneIdentity, Thresholds};
use frugal_core::power::MeterInfo;

use super::{Outcome, PipelineConfig, Subject};
use crate::cost::{saved_joules, work_prices};

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

//! Keeps the mean of an error budget where views are not those that the map was calibrated on.
//!
//! Dual ascent (Arrow, Hurwicz and Uzawa 1958; Boyd and Vandenberghe 2004, section 5.4): while
//! frames are predicted to have more error than the mean that was asked for, what error is worth
//! rises; while they have less, it falls. A walk through easy views then costs less power, and one
//! through hard views keeps its mean.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use super::{Budget, Choice, select};
use crate::frontier::{CameraView, FrontierStore, SampleCamera};

/// Seconds in which twice the error that was asked for changes its worth by a factor of e. Higher
/// values hold settings steadier; lower ones hold the mean over shorter stretches.
const PACE_SECONDS: f64 = 2.0;
/// Greatest factor on the calibrated worth, either way: what goes beyond is no error budget's
/// doing.
const MOST: f64 = 16.0;
/// The longest frame that counts, seconds: a pause is no evidence.
const LONGEST_FRAME: f64 = 0.25;

/// How far a camera's views are from those that the map's error budgets were calibrated on. Written
/// by the controller.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct ErrorPace {
    /// ln of the factor on the calibrated worth of error.
    logarithm: f64,
    /// The budget that it belongs to.
    budget: Option<f64>,
}

impl ErrorPace {
    /// Factor on the calibrated worth of error, 1/16 to 16; 1 at first.
    pub fn factor(&self) -> f64 {
        self.logarithm.exp()
    }

    /// A frame of `delta_seconds` is predicted to have `error`; `target`: the mean that is wanted.
    fn observe(&mut self, error: f64, target: f64, delta_seconds: f64) {
        let step = delta_seconds.clamp(0.0, LONGEST_FRAME) / PACE_SECONDS * (error / target - 1.0);
        if step.is_finite() {
            self.logarithm = (self.logarithm + step).clamp(-MOST.ln(), MOST.ln());
        }
    }
}

/// What `budget` buys at `view`, and the sample camera that says so: [`select`] at the exchange
/// rate that keeps the mean of an error budget. The same for apps and for `frugal evaluate`.
///
/// `None` where no frontier is known there, or the budget is not valid.
pub fn choose(
    store: &dyn FrontierStore,
    view: &CameraView,
    budget: &Budget,
    pace: &mut ErrorPace,
    delta_seconds: f64,
) -> Option<(SampleCamera, Choice)> {
    if pace.budget != budget.error {
        *pace = ErrorPace { logarithm: 0.0, budget: budget.error };
    }
    let found = store.look_up(view)?;
    let rate =
        budget.error.and_then(|error| store.error_rate(error)).map(|rate| rate * pace.factor());
    let choice = select(found.frontier, budget, rate)?;
    if let (None, Some(target)) =
        (budget.power, budget.error.and_then(|error| store.error_target(error)))
    {
        pace.observe(choice.cost.error, target, delta_seconds);
    }
    Some((found.camera, choice))
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, Vec3};

    use super::*;
    use crate::frontier::{
        CostPoint, ErrorRate, ErrorRates, Frontier, FrontierPoint, SampleRef, ViewDirection,
    };
    use crate::knobs::{KnobSpace, RenderSettings};

    /// Easy views where x is below 0, hard ones elsewhere: an error of 0.015 or 0.1 at 1 W, falling
    /// as 1 / W.
    struct TwoViews(KnobSpace, [Frontier; 2], ErrorRates);

    fn store(target: Option<f64>) -> TwoViews {
        let frontier = |error: f64| {
            let point = |level: u64| {
                let power = 1.0 + 0.1 * level as f64;
                FrontierPoint {
                    settings: RenderSettings::from_bits(level),
                    cost: CostPoint::new(power, error / power.powi(2)),
                }
            };
            Frontier::from_points((0..100).map(point))
        };
        let rate = ErrorRate { budget: 0.02, watts_per_error: 50.0, predicted: target };
        TwoViews(
            KnobSpace::new(Vec::new()).expect("no knobs"),
            [frontier(0.015), frontier(0.1)],
            ErrorRates(vec![rate]),
        )
    }

    impl FrontierStore for TwoViews {
        fn look_up(&self, view: &CameraView) -> Option<SampleRef<'_>> {
            let camera = SampleCamera {
                corner: 0,
                position: Vec3::ZERO,
                direction: ViewDirection::PositiveX,
            };
            Some(SampleRef { camera, frontier: &self.1[usize::from(view.position.x >= 0.0)] })
        }
        fn knobs(&self) -> &KnobSpace {
            &self.0
        }
        fn error_rate(&self, budget: f64) -> Option<f64> {
            self.2.rate(budget)
        }
        fn error_target(&self, budget: f64) -> Option<f64> {
            self.2.target(budget)
        }
    }

    fn view(x: f32) -> CameraView {
        CameraView {
            position: Vec3::X * x,
            rotation: Quat::IDENTITY,
            vertical_fov: 1.0,
            aspect: 1.0,
        }
    }

    /// Mean error and power of 20 s at 30 Hz.
    fn played(
        store: &TwoViews,
        x: impl Fn(usize) -> f32,
        budget: Budget,
        delta: f64,
    ) -> (f64, f64) {
        let mut pace = ErrorPace::default();
        let costs: Vec<CostPoint> = (0..600)
            .map(|frame| {
                choose(store, &view(x(frame)), &budget, &mut pace, delta)
                    .expect("a frontier")
                    .1
                    .cost
            })
            .collect();
        let mean = |value: fn(&CostPoint) -> f64| costs.iter().map(value).sum::<f64>() / 600.0;
        (mean(|cost| cost.error), mean(|cost| cost.power.0))
    }

    #[test]
    fn the_mean_is_kept_on_views_harder_and_easier_than_those_calibrated_on() {
        let (paced, plain) = (store(Some(0.019)), store(None));
        let budget = Budget::error(0.02);
        let mixed = |frame: usize| if (frame / 60).is_multiple_of(2) { -1.0 } else { 1.0 };
        let (error, _) = played(&paced, mixed, budget, 1.0 / 30.0);
        assert!((0.015..0.0205).contains(&error), "{error}");
        let hard = played(&paced, |_| 1.0, budget, 1.0 / 30.0).0;
        let before = played(&plain, |_| 1.0, budget, 1.0 / 30.0).0;
        assert!((0.017..0.0205).contains(&hard) && before > 0.0205, "{hard}, {before}");
        let easy = played(&paced, |_| -1.0, budget, 1.0 / 30.0).1;
        assert!(easy < played(&plain, |_| -1.0, budget, 1.0 / 30.0).1);
    }

    #[test]
    fn power_limits_have_no_pace_and_odd_frames_leave_it_finite() {
        let store = store(Some(0.019));
        let mut pace = ErrorPace::default();
        let both = Budget::both(crate::units::Watts(3.0), 0.02);
        choose(&store, &view(1.0), &both, &mut pace, 1.0);
        assert_eq!(pace.factor(), 1.0);
        for delta in [f64::NAN, f64::INFINITY, -1.0, 1e300, 0.0] {
            let budget = Budget::error(0.02);
            for _ in 0..1000 {
                choose(&store, &view(1.0), &budget, &mut pace, delta);
            }
            assert!((1.0 / 16.0..=16.0001).contains(&pace.factor()), "{delta}: {}", pace.factor());
        }
        // Another budget begins anew.
        choose(&store, &view(1.0), &Budget::error(0.05), &mut pace, 0.0);
        assert_eq!(pace.factor(), 1.0);
        for odd in [0.0, f64::INFINITY] {
            choose(&store, &view(1.0), &Budget::error(odd), &mut pace, 0.1);
            assert!(pace.factor().is_finite());
        }
    }
}

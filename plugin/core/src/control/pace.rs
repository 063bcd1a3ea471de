//! Keeps the mean error within its budget where views differ from those that the map was calibrated
//! on.
//!
//! Dual ascent (Arrow, Hurwicz and Uzawa 1958; Boyd and Vandenberghe 2004, section 5.4): the error
//! rate λ (watts per unit of error) rises while the predicted error of the applied settings exceeds
//! the target mean, and falls while it is below. A path through easy views then costs less power,
//! and a path through hard views keeps its mean. Where no point of a frontier has the target's error,
//! two points take turns, which costs less than the better one throughout.

use super::limits::Limits;
use super::select::select_within;
use super::{Choice, ErrorFeedback, ErrorPrice, Outcome};
use crate::frontier::{CostPoint, Frontier, FrontierStore};

/// Seconds in which an error of twice the target changes the error rate by a factor of e. Higher
/// values keep settings more stable; lower values keep the mean over shorter intervals.
const TIME_CONSTANT_SECONDS: f64 = 4.0;
/// Largest factor on the calibrated error rate, up and down: a larger deviation has other causes
/// than the error budget.
const MAX_FACTOR: f64 = 16.0;
/// Upper limit of a frame's duration, seconds: a pause says nothing about the views.
const MAX_FRAME_SECONDS: f64 = 0.25;

/// Correction of the error rate for a camera whose views differ from those that the map's error
/// budgets were calibrated on. Written by the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component))]
pub struct ErrorPace {
    /// ln of the factor on the calibrated error rate.
    logarithm: f64,
    /// The error budget that the factor belongs to.
    budget: Option<f64>,
}

impl ErrorPace {
    /// Factor on the calibrated error rate, no unit, 1/16 to 16; initially 1. Above 1 the views are
    /// harder than the calibration views.
    pub fn factor(&self) -> f64 {
        self.logarithm.exp()
    }

    /// Takes account of a frame of `delta_seconds` (seconds; counts as 0 to 0.25 s) that is rendered
    /// with settings of the predicted `applied` cost, on their way to `choice`.
    ///
    /// Nothing changes unless an error limit decides, and `store` or `measured` knows its target.
    pub fn observe(
        &mut self,
        store: &dyn FrontierStore,
        measured: &ErrorFeedback,
        choice: &Choice,
        applied: CostPoint,
        delta_seconds: f64,
    ) {
        // Where power limits the choice, the error says nothing about the rate.
        if matches!(choice.outcome, Outcome::LimitedByPower | Outcome::PowerCannotBeMet) {
            return;
        }
        let target = |budget| measured.target(budget, store.error_target(budget));
        if let Some(target) = self.budget.and_then(target) {
            self.step(applied.error, target, delta_seconds);
        }
    }

    /// Dual-ascent step for a frame of `delta_seconds` with the predicted `error`, towards the mean
    /// `target`.
    fn step(&mut self, error: f64, target: f64, delta_seconds: f64) {
        let step = delta_seconds.clamp(0.0, MAX_FRAME_SECONDS) / TIME_CONSTANT_SECONDS
            * (error / target - 1.0);
        // Reflection may write NaN, which would stay for ever.
        let logarithm = if self.logarithm.is_finite() { self.logarithm } else { 0.0 };
        let step = if step.is_finite() { step } else { 0.0 };
        self.logarithm = (logarithm + step).clamp(-MAX_FACTOR.ln(), MAX_FACTOR.ln());
    }
}

/// The best choice on `frontier` within `limits`, at the exchange rate of `store` that keeps the mean
/// of an error budget. `None` where the frontier is empty. Apps and `frugal evaluate` share this
/// function.
///
/// `pace` is reset when the error limit changes, and otherwise left to [`ErrorPace::observe`].
/// `measured`: what measurements say of predicted errors; once there is one, errors weigh as
/// [`ErrorPrice::measured`] says.
pub fn choose(
    store: &dyn FrontierStore,
    frontier: &Frontier,
    limits: &Limits,
    measured: &ErrorFeedback,
    pace: &mut ErrorPace,
) -> Option<Choice> {
    if pace.budget != limits.error {
        *pace = ErrorPace { logarithm: 0.0, budget: limits.error };
    }
    let price = |error: f64| {
        let rate = store.error_rate(error)? * pace.factor();
        let target = measured.target(error, store.error_target(error));
        Some(match target.filter(|_| measured.count() > 0.0) {
            Some(target) => ErrorPrice::measured(rate, target),
            None => ErrorPrice::calibrated(rate, error),
        })
    };
    let price = limits.error.and_then(price);
    select_within(frontier, limits, price)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::control::Budget;
    use crate::frontier::{
        CameraView, ErrorRate, ErrorRates, FrontierPoint, SampleCamera, SampleRef, ViewDirection,
    };
    use crate::knobs::{KnobLevels, KnobSpace};
    use crate::testing;

    /// Easy views where x is below 0, hard ones elsewhere: an error of 0.015 or 0.14 at 1 W, falling
    /// as 1 / W.
    struct TwoViews(KnobSpace, [Frontier; 2], ErrorRates);

    fn store(target: Option<f64>) -> TwoViews {
        let frontier = |error: f64| {
            let point = |level: u128| {
                let power = 1.0 + 0.1 * level as f64;
                FrontierPoint {
                    settings: KnobLevels::from_bits(level),
                    cost: CostPoint::new(power, error / power.powi(2)),
                }
            };
            Frontier::from_points((0..100).map(point))
        };
        let rate = ErrorRate { budget: 0.02, watts_per_error: 15.0, predicted: target };
        TwoViews(
            KnobSpace::new(Vec::new()).expect("no knobs"),
            [frontier(0.015), frontier(0.14)],
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
        CameraView { position: Vec3::X * x, ..testing::view() }
    }

    /// Chooses, and applies the choice at once.
    fn play(
        store: &TwoViews,
        x: f32,
        budget: &Budget,
        pace: &mut ErrorPace,
        delta: f64,
    ) -> Option<CostPoint> {
        let found = store.look_up(&view(x))?;
        let limits = budget.limits().expect("valid limits");
        let choice = choose(store, found.frontier, &limits, &ErrorFeedback::default(), pace)?;
        pace.observe(store, &ErrorFeedback::default(), &choice, choice.cost, delta);
        Some(choice.cost)
    }

    /// Mean error and power of 20 s at 30 Hz.
    fn mean_cost(
        store: &TwoViews,
        x: impl Fn(usize) -> f32,
        budget: Budget,
        delta: f64,
    ) -> (f64, f64) {
        let mut pace = ErrorPace::default();
        let costs: Vec<CostPoint> = (0..600)
            .map(|frame| play(store, x(frame), &budget, &mut pace, delta).expect("a frontier"))
            .collect();
        let mean = |value: fn(&CostPoint) -> f64| costs.iter().map(value).sum::<f64>() / 600.0;
        (mean(|cost| cost.error), mean(|cost| cost.power.0))
    }

    #[test]
    fn the_mean_is_kept_on_views_harder_and_easier_than_those_calibrated_on() {
        let (corrected, uncorrected) = (store(Some(0.019)), store(None));
        let budget = Budget::error(0.02);
        let mixed = |frame: usize| if (frame / 60).is_multiple_of(2) { -1.0 } else { 1.0 };
        let (error, _) = mean_cost(&corrected, mixed, budget, 1.0 / 30.0);
        assert!((0.015..0.0205).contains(&error), "{error}");
        let hard = mean_cost(&corrected, |_| 1.0, budget, 1.0 / 30.0).0;
        let before = mean_cost(&uncorrected, |_| 1.0, budget, 1.0 / 30.0).0;
        assert!((0.017..0.0205).contains(&hard) && before > 0.0205, "{hard}, {before}");
        let easy = mean_cost(&corrected, |_| -1.0, budget, 1.0 / 30.0).1;
        assert!(easy < mean_cost(&uncorrected, |_| -1.0, budget, 1.0 / 30.0).1);
    }

    #[test]
    fn power_limits_leave_the_factor_at_one_and_extreme_frames_leave_it_finite() {
        let store = store(Some(0.019));
        let mut pace = ErrorPace::default();
        let both = Budget::both(crate::units::Watts(1.2), 0.02);
        play(&store, 1.0, &both, &mut pace, 1.0);
        assert_eq!(pace.factor(), 1.0);
        for delta in [f64::NAN, f64::INFINITY, -1.0, 1e300, 0.0] {
            let budget = Budget::error(0.02);
            for _ in 0..1000 {
                play(&store, 1.0, &budget, &mut pace, delta);
            }
            assert!((1.0 / 16.0..=16.0001).contains(&pace.factor()), "{delta}: {}", pace.factor());
        }
        // A factor that reflection broke does not stay broken.
        pace.logarithm = f64::NAN;
        for _ in 0..3 {
            assert!(play(&store, 1.0, &Budget::error(0.02), &mut pace, 0.1).is_some());
        }
        assert!(pace.factor().is_finite());
        // Another budget resets the factor.
        play(&store, 1.0, &Budget::error(0.05), &mut pace, 0.0);
        assert_eq!(pace.factor(), 1.0);
        for odd in [0.0, f64::INFINITY] {
            play(&store, 1.0, &Budget::error(odd), &mut pace, 0.1);
            assert!(pace.factor().is_finite());
        }
    }
}

//! Converts all limits of a budget into three: mean power, power of each frame, mean error.
//!
//! Limits become watts of one camera, and the least of each kind holds.

use super::observed::Observed;
use super::{Budget, BudgetError, Limit, PowerCorrection};
use crate::units::Watts;

/// The valid limits of one camera in one frame: each is `None`, or a number of 0 or more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Limit on the mean power, watts.
    pub power: Option<Watts>,
    /// Limit on the mean error, 1 − SSIM.
    pub error: Option<f64>,
    /// The currency that the power limit comes from.
    pub power_by: Option<Limit>,
    /// Limit on the power of each frame, watts.
    pub peak: Option<Watts>,
    /// The currency that the peak comes from.
    pub peak_by: Option<Limit>,
    /// Time over which means are taken, seconds.
    pub horizon: f64,
}

/// Resolves all limits of `budget`. Limits of the whole app are shared equally by its cameras.
///
/// Monotone: a looser limit, more energy left and more headroom never lower the power.
///
/// # Errors
/// [`BudgetError`] for a limit that is [invalid](Budget::validate).
pub fn resolve(budget: &Budget, observed: &Observed) -> Result<Limits, BudgetError> {
    budget.validate()?;
    let part = 1.0 / observed.cameras.max(1) as f64;
    let in_app = |predicted: Watts| observed.correction.corrected(predicted) * part;
    let energy = budget.energy_per_frame.zip(observed.frames_per_second);
    let energy = energy.map(|(energy, rate)| Watts(energy.0 * rate * part));
    let battery = budget.battery_until.zip(observed.battery).and_then(|(until, energy)| {
        let left = until.as_secs_f64() - observed.now_seconds;
        // Past the deadline there is no limit.
        let watts = (left > 0.0).then(|| energy.per_seconds(left))?;
        let predicted = observed.battery_power.map(|exchange| in_app(exchange.predicted(watts.0)));
        Some(predicted.unwrap_or(watts * part))
    });
    let headroom = budget.headroom.zip(observed.headroom).zip(observed.range);
    let headroom = headroom.and_then(|((keep, headroom), (least, most))| {
        let share = headroom / keep;
        (share < 1.0).then(|| least + (most - least) * share)
    });
    // A frame that takes too long is late, whatever others take.
    let time = budget.frame_time.zip(observed.frame_time);
    let time = time.map(|(limit, exchange)| in_app(exchange.predicted(limit.as_secs_f64())));
    let (power, power_by) = tightest(&[
        (Limit::Power, budget.power),
        (Limit::EnergyPerFrame, energy),
        (Limit::Battery, battery),
        (Limit::Headroom, headroom),
    ]);
    let (peak, peak_by) = tightest(&[(Limit::Peak, budget.peak), (Limit::FrameTime, time)]);
    let (error, horizon) = (budget.error, budget.horizon.as_secs_f64());
    Ok(Limits { power, error, power_by, peak, peak_by, horizon })
}

/// The least of the limits, and its currency.
fn tightest(limits: &[(Limit, Option<Watts>)]) -> (Option<Watts>, Option<Limit>) {
    let mut tightest = (None, None);
    for (limit, power) in limits {
        // Infinity limits nothing, and NaN is no number of watts.
        let Some(power) = power.filter(|power| power.0 < f64::INFINITY) else { continue };
        let power = Watts(power.0.max(0.0));
        if tightest.0.is_none_or(|least| power < least) {
            tightest = (Some(power), Some(*limit));
        }
    }
    tightest
}

impl Limits {
    /// The same in the watts of a map. Finite limits stay finite.
    pub fn uncorrected(self, correction: PowerCorrection) -> Self {
        let stored = |limit: Option<Watts>| limit.map(|limit| correction.uncorrected(limit));
        Self { power: stored(self.power), peak: stored(self.peak), ..self }
    }
}

#[cfg(test)]
#[path = "limits_tests.rs"]
mod tests;

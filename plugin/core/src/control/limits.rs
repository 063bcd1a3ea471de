//! Limits in all currencies, as one limit of power and one of error.
//!
//! Each limit becomes watts of one camera, and the least of them holds.

use super::observed::Observed;
use super::{Budget, BudgetError, Limit, PowerCorrection};
use crate::units::Watts;

/// The valid limits of one camera in one frame: each is `None`, or a number of 0 or more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Power limit, watts.
    pub power: Option<Watts>,
    /// Error limit, 1 − SSIM.
    pub error: Option<f64>,
    /// The currency that the power limit comes from.
    pub power_by: Option<Limit>,
}

impl Budget {
    /// The limits of power and error alone.
    pub fn limits(&self) -> Result<Limits, BudgetError> {
        self.validate()?;
        Ok(Limits {
            power: self.power,
            error: self.error,
            power_by: self.power.map(|_| Limit::Power),
        })
    }
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
    let limits = [
        (Limit::Power, budget.power),
        (
            Limit::EnergyPerFrame,
            budget
                .energy_per_frame
                .zip(observed.frames_per_second)
                .map(|(energy, rate)| Watts(energy.0 * rate * part)),
        ),
        (
            Limit::FrameTime,
            budget
                .frame_time
                .zip(observed.frame_time)
                .map(|(limit, exchange)| in_app(exchange.predicted(limit.as_secs_f64()))),
        ),
        (
            Limit::Battery,
            budget.battery_until.zip(observed.battery).and_then(|(until, energy)| {
                let left = until.as_secs_f64() - observed.now_seconds;
                // Past the deadline there is no limit.
                let watts = (left > 0.0).then(|| energy.per_seconds(left))?;
                Some(match observed.battery_power {
                    Some(exchange) => in_app(exchange.predicted(watts.0)),
                    None => watts * part,
                })
            }),
        ),
        (
            Limit::Headroom,
            budget.headroom.zip(observed.headroom).zip(observed.range).and_then(
                |((keep, headroom), (least, most))| {
                    let share = headroom / keep;
                    (share < 1.0).then(|| least + (most - least) * share)
                },
            ),
        ),
    ];
    let mut tightest = Limits { error: budget.error, ..Limits::default() };
    for (limit, power) in limits {
        // Infinity limits nothing, and NaN is no number of watts.
        let Some(power) = power.filter(|power| power.0 < f64::INFINITY) else { continue };
        let power = Watts(power.0.max(0.0));
        if tightest.power.is_none_or(|least| power < least) {
            (tightest.power, tightest.power_by) = (Some(power), Some(limit));
        }
    }
    Ok(tightest)
}

impl Limits {
    /// The same in the watts of a map. Finite limits stay finite.
    pub fn uncorrected(self, correction: PowerCorrection) -> Self {
        Self { power: self.power.map(|limit| correction.uncorrected(limit)), ..self }
    }

    /// The power limit; `None` where it is infinite.
    pub fn finite_power(&self) -> Option<f64> {
        self.power.map(|limit| limit.0).filter(|limit| *limit < f64::INFINITY)
    }
}

#[cfg(test)]
#[path = "limits_tests.rs"]
mod tests;

//! Limits in other currencies, as one limit of power and one of error.
//!
//! Each limit becomes watts of one camera, and the least of them holds. A limit whose signal is not
//! known is none for the time being: it is no reason for bad pictures.

use bevy::reflect::Reflect;

use super::{Budget, Choice, Outcome, PowerCorrection};
use crate::frontier::Frontier;
use crate::units::{Joules, Watts};

/// A currency of a [`Budget`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[non_exhaustive]
pub enum Limit {
    /// Power, in watts.
    Power,
    /// Error, as 1 − SSIM.
    Error,
    /// Energy of a frame, in joules.
    EnergyPerFrame,
    /// Time of a frame's work.
    FrameTime,
    /// Time until the battery is empty.
    Battery,
    /// Distance from throttling.
    Headroom,
    /// The camera's part of an [`AppBudget`](super::AppBudget).
    AppBudget,
}

/// Watts of a map by readings of another quantity, of all controlled cameras together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exchange {
    /// Scaled readings per predicted watt, and their offset.
    pub(super) correction: PowerCorrection,
    /// Factor on readings: the first one's predicted watts.
    pub(super) scale: f64,
}

impl Exchange {
    /// The predicted power at which the quantity is `limit`, in the map's watts; at least 0.
    fn predicted(&self, limit: f64) -> Watts {
        self.correction.uncorrected(Watts(limit * self.scale))
    }
}

/// What is known of the app and its device when limits are resolved; `None` is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Observed {
    /// Frames per second that watts refer to.
    pub(super) frames_per_second: Option<f64>,
    /// Frame time in seconds, in terms of predicted power.
    pub(super) frame_time: Option<Exchange>,
    /// Seconds since the app has started.
    pub(super) now_seconds: f64,
    /// Energy left in the battery.
    pub(super) battery: Option<Joules>,
    /// The battery's power in watts, in terms of predicted power. `None`: the battery feeds the
    /// cameras alone.
    pub(super) battery_power: Option<Exchange>,
    /// Distance from throttling, 0 to 1.
    pub(super) headroom: Option<f64>,
    /// From the map's watts to those of the app's meter, of all cameras together.
    pub(super) correction: PowerCorrection,
    /// Number of active controlled cameras; 0 counts as 1.
    pub(super) cameras: usize,
    /// Least and most power of the camera's settings, in the watts of the app's meter.
    pub(super) range: Option<(Watts, Watts)>,
}

/// The limits of one camera, with the currency of its power limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Envelope {
    /// Power limit, in the watts of the app's meter; at least 0.
    pub(super) power: Option<Watts>,
    /// What it comes from.
    pub(super) power_by: Option<Limit>,
    /// Error limit.
    pub(super) error: Option<f64>,
}

/// Resolves all limits of a [valid](Budget::validate) budget. Limits of the whole app are shared
/// equally by its cameras.
///
/// Monotone: a looser limit, more energy left and more headroom never lower the power.
pub(super) fn resolve(budget: &Budget, observed: &Observed) -> Envelope {
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
                // Later the promise is kept.
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
    let mut envelope = Envelope { error: budget.error, ..Envelope::default() };
    for (limit, power) in limits {
        // Infinity limits nothing, and NaN is no number of watts.
        let Some(power) = power.filter(|power| power.0 < f64::INFINITY) else { continue };
        let power = Watts(power.0.max(0.0));
        if envelope.power.is_none_or(|least| power < least) {
            (envelope.power, envelope.power_by) = (Some(power), Some(limit));
        }
    }
    envelope
}

impl Envelope {
    /// The budget of power and error.
    pub(super) fn budget(&self) -> Budget {
        Budget::new(self.power, self.error)
    }

    /// What keeps the settings of `choice` from being better; `None`: nothing, they are the best, or
    /// no limit was given. `power` is the power limit in the watts of `frontier`.
    pub(super) fn binds(
        &self,
        power: Option<Watts>,
        frontier: &Frontier,
        choice: &Choice,
    ) -> Option<Limit> {
        let dearer = frontier.points().iter().find(|point| point.cost.power > choice.cost.power);
        match choice.outcome {
            Outcome::ErrorCannotBeMet => Some(Limit::Error),
            Outcome::LimitedByPower | Outcome::PowerCannotBeMet => self.power_by,
            _ => {
                let dearer = dearer?;
                let is_power = power.is_some_and(|limit| dearer.cost.power > limit);
                if is_power { self.power_by } else { self.error.map(|_| Limit::Error) }
            }
        }
    }
}

#[cfg(test)]
#[path = "limits_tests.rs"]
mod tests;

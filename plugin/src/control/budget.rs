//! The power and error limits of a camera.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use crate::units::Watts;

/// Limits on a camera's power, error, or both. Without a limit the controller selects the best
/// settings.
///
/// - Power only: least error within the limit, in every frame (Wang et al. 2016, equation 3.2).
/// - Error only: least power whose mean error stays within the limit (equation 3.3; for the mean
///   see [`ErrorRates`](crate::frontier::ErrorRates)).
/// - Both: least power whose mean error stays within the error limit, as long as that is within the
///   power limit; else the least error within the power limit.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Budget {
    /// Power limit, in watts, at the frame rate of the frontier map; at least 0, infinity for no
    /// limit.
    ///
    /// Higher values improve quality and cost more power; lower values cost less and raise the
    /// error. No settings cost 0 W: the controller then selects the cheapest and reports the unmet
    /// limit in the [selection](super::Selection).
    pub power: Option<Watts>,
    /// Limit on the error averaged over frames: 1 − SSIM against the best settings, 0 to 2; at
    /// least 0, infinity for no limit.
    ///
    /// Higher values cost less power and lower quality; lower values cost more. A single frame in
    /// which error is expensive to reduce may exceed the limit, by at most
    /// [`MOST_OVER_MEAN`](super::MOST_OVER_MEAN).
    pub error: Option<f64>,
}

/// Invalid budget: a limit that is NaN or negative.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// The power limit, in watts, is NaN or negative.
    #[error("power budget of {0} W: give a number of watts of 0 or more, or no limit")]
    Power(f64),
    /// The error limit (1 − SSIM) is NaN or negative.
    #[error("error budget of {0}: give 1 - SSIM as a number of 0 or more, or no limit")]
    Error(f64),
}

impl Budget {
    /// The limits that are given, in watts and as 1 − SSIM; `None` is no limit.
    pub const fn new(power: Option<Watts>, error: Option<f64>) -> Self {
        Self { power, error }
    }

    /// Least error within `power`, in watts.
    pub const fn power(power: Watts) -> Self {
        Self { power: Some(power), error: None }
    }

    /// Least power whose mean error is at most `error` (1 − SSIM, no unit).
    pub const fn error(error: f64) -> Self {
        Self { power: None, error: Some(error) }
    }

    /// Both limits, in watts and as 1 − SSIM. Power takes priority where they conflict.
    pub const fn both(power: Watts, error: f64) -> Self {
        Self { power: Some(power), error: Some(error) }
    }

    /// Checks that each limit is at least 0. Infinity is valid.
    ///
    /// # Errors
    /// [`BudgetError`] for a limit that is NaN or negative; the power limit is checked first.
    pub fn validate(&self) -> Result<(), BudgetError> {
        // This comparison rejects NaN.
        let valid = |limit: f64| limit >= 0.0;
        match (self.power, self.error) {
            (Some(Watts(power)), _) if !valid(power) => Err(BudgetError::Power(power)),
            (_, Some(error)) if !valid(error) => Err(BudgetError::Error(error)),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_and_infinity_are_valid_limits_nan_and_negative_numbers_are_not() {
        for limit in [0.0, -0.0, 1e-300, 7.0, f64::INFINITY] {
            assert_eq!(Budget::power(Watts(limit)).validate(), Ok(()));
            assert_eq!(Budget::error(limit).validate(), Ok(()));
            assert_eq!(Budget::both(Watts(limit), limit).validate(), Ok(()));
        }
        for limit in [f64::NAN, -1e-300, -7.0, f64::NEG_INFINITY] {
            assert!(matches!(Budget::power(Watts(limit)).validate(), Err(BudgetError::Power(_))));
            assert!(matches!(Budget::error(limit).validate(), Err(BudgetError::Error(_))));
            assert!(matches!(
                Budget::both(Watts(1.0), limit).validate(),
                Err(BudgetError::Error(_))
            ));
        }
        assert_eq!(Budget::default().validate(), Ok(()));
    }

    #[test]
    fn the_message_tells_the_value_and_the_remedy() {
        let message =
            Budget::power(Watts(-2.0)).validate().expect_err("a negative budget").to_string();
        assert!(message.contains("-2 W") && message.contains("0 or more"), "{message}");
    }
}

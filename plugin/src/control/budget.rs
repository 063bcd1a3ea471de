//! What a camera may cost.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use crate::units::Watts;

/// A limit on a camera's power, on its error, or on both. Without any, quality is the best that
/// there is.
///
/// Power alone: the least error within it, in every frame. Error alone: the least power for which
/// the mean error keeps it (Wang et al. 2016, equations 3.2 and 3.3; for the mean see
/// [`ErrorRates`](crate::frontier::ErrorRates)). Both: the least error within the power, and where
/// the two conflict, power binds.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct Budget {
    /// Most power, in watts, at the frame rate that the frontier map was made for. Higher values
    /// give better pictures. At least 0; infinity is no limit. No settings cost 0 W: the cheapest
    /// are taken, and the [selection](super::Selection) says that the budget cannot be met.
    pub power: Option<Watts>,
    /// Most error in the mean over frames: 1 − SSIM against the best settings, 0 to 2. Higher
    /// values cost less power. At least 0; infinity is no limit. A frame in which error is dear to
    /// remove may have [more](super::MOST_OVER_MEAN), others have less.
    pub error: Option<f64>,
}

/// A limit that limits nothing and is not infinite either.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// NaN or a negative number of watts.
    #[error(
        "power budget of {0} W: give a number of watts that is 0 or more, or none for no limit"
    )]
    Power(f64),
    /// NaN or a negative error.
    #[error(
        "error budget of {0}: give a number that is 0 or more (1 - SSIM), or none for no limit"
    )]
    Error(f64),
}

impl Budget {
    /// The least error that `power` buys.
    pub const fn power(power: Watts) -> Self {
        Self { power: Some(power), error: None }
    }

    /// The least power whose error is at most `error` (1 − SSIM, without unit).
    pub const fn error(error: f64) -> Self {
        Self { power: None, error: Some(error) }
    }

    /// Both limits. Power binds where they conflict.
    pub const fn both(power: Watts, error: f64) -> Self {
        Self { power: Some(power), error: Some(error) }
    }

    /// Checks that each limit is a number, 0 or more. Infinity is.
    ///
    /// # Errors
    /// For NaN and for negative numbers.
    pub fn validate(&self) -> Result<(), BudgetError> {
        // Written so that NaN fails.
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
    fn zero_and_infinity_are_limits_while_nan_and_negative_numbers_are_not() {
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

//! What an app sets of the controller.

use std::time::Duration;

#[cfg(feature = "bevy")]
use bevy_ecs::reflect::ReflectResource;
#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;

use super::Budget;

/// Settings of the controller, for all cameras. Times are real time: [`Duration::ZERO`] switches at
/// once, [`Duration::MAX`] never.
///
/// Settings fall quickly when the power limit is exceeded and rise slowly when power is left over.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_ecs::resource::Resource, bevy_reflect::Reflect),
    reflect(Resource, Default, Clone, Debug, PartialEq)
)]
pub struct ControlSettings {
    /// Duration of every transition except a fall under a power limit. Higher values change quality
    /// more gradually and follow the view later, which costs power under an error limit; lower
    /// values follow sooner and change quality more visibly. Default: 1 s; Wang et al. 2016, equation
    /// 3.8, use 2 s.
    pub transition: Duration,
    /// Duration of a fall to cheaper settings under a power limit. Lower values end an excess over
    /// the limit sooner and change quality more visibly; higher values change it more gradually and
    /// exceed the limit for longer. Default: 0.5 s.
    pub fall: Duration,
    /// Shortest time between two changes of the target. It ends early when the budget cannot bear
    /// the present target, with another budget, and at a cut. Higher values change quality less
    /// often and follow views less closely. Default: 1 s.
    pub dwell: Duration,
    /// Whether the app's meter corrects predicted power: a measured one, or the modelled one that the
    /// map was made with. Default: true.
    pub power_feedback: bool,
}

impl ControlSettings {
    /// Default of [`transition`](Self::transition).
    pub const TRANSITION: Duration = Duration::from_secs(1);

    /// Transition times under `budget`. An infinite limit counts as none. With two limits the power
    /// limit decides, as it does where they conflict. An error limit alone applies to the mean, so
    /// neither direction is more urgent.
    pub fn times(&self, budget: &Budget) -> TransitionTimes {
        if budget.power.is_some_and(|limit| limit.0 < f64::INFINITY) {
            TransitionTimes { rise: self.transition, fall: self.fall }
        } else {
            TransitionTimes::both(self.transition)
        }
    }
}

impl Default for ControlSettings {
    fn default() -> Self {
        Self {
            transition: Self::TRANSITION,
            fall: Duration::from_millis(500),
            dwell: Duration::from_secs(1),
            power_feedback: true,
        }
    }
}

/// Duration of a knob's transition to its new level. Levels are ordered cheapest first: falling
/// saves power, rising reduces error.
///
/// Higher values change quality more gradually and take longer to end an excess over the budget.
/// [`Duration::ZERO`] switches at once, [`Duration::MAX`] never.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransitionTimes {
    /// To a more expensive level. Lower values raise quality sooner and more visibly; higher values
    /// save power during the transition.
    pub rise: Duration,
    /// To a cheaper level. Lower values reduce power sooner and more visibly; higher values keep
    /// quality, at its power, during the transition.
    pub fall: Duration,
}

impl TransitionTimes {
    /// `time` in both directions, as in the closed form of Wang et al.
    pub const fn both(time: Duration) -> Self {
        Self { rise: time, fall: time }
    }

    /// Fraction of a transition in `delta_seconds`, 0 to 1, for a knob with `remaining` levels to
    /// go.
    pub(super) fn fraction(self, delta_seconds: f64, remaining: f64) -> f64 {
        match if remaining > 0.0 { self.rise } else { self.fall } {
            Duration::ZERO => 1.0,
            Duration::MAX => 0.0,
            time => (delta_seconds / time.as_secs_f64()).min(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Watts;

    #[test]
    fn falls_under_a_power_limit_are_fast() {
        let (slow, fast) = (Duration::from_secs(3), Duration::from_millis(250));
        let settings =
            ControlSettings { transition: slow, fall: fast, ..ControlSettings::default() };
        let power = TransitionTimes { rise: slow, fall: fast };
        let error = TransitionTimes::both(slow);
        let none = Watts(f64::INFINITY);
        for (budget, expected) in [
            (Budget::power(Watts(5.0)), power),
            (Budget::power(Watts(0.0)), power),
            (Budget::both(Watts(5.0), 0.1), power),
            (Budget::error(0.1), error),
            (Budget::both(none, 0.1), error),
            (Budget::default(), error),
            (Budget::both(none, f64::INFINITY), error),
        ] {
            assert_eq!(settings.times(&budget), expected, "{budget:?}");
        }
        let default = ControlSettings::default();
        let usual = TransitionTimes::both(ControlSettings::TRANSITION);
        assert_eq!(default.times(&Budget::default()), usual);
    }
}

//! What an app sets of the controller: the limits of a camera, and times of transitions.

use std::time::Duration;

#[cfg(feature = "bevy")]
use bevy_ecs::reflect::{ReflectComponent, ReflectResource};
#[cfg(feature = "bevy")]
use bevy_reflect::std_traits::ReflectDefault;

use crate::units::{Joules, Watts};

/// Limits on a camera's power, error and other quantities. By default there is none, and the
/// controller selects the best settings.
///
/// - Power only: the least error whose mean power stays within the limit. Every frame takes the
///   settings with the least power + λ × error (Everett 1963), so that cheap views pay for dear
///   ones.
/// - Error only: the least power whose mean error stays within the limit.
/// - Both: the least power whose mean error stays within the error limit, if that is within the
///   power limit; else the least error within the power limit.
///
/// Means are over the last [`horizon`](Self::horizon). [`peak`](Self::peak) limits each frame.
///
/// Signals of the app and its device convert limits of other quantities into power limits. The
/// tightest one holds; `Selection::binding` names it. A limit begins with the first value of its
/// signal. If values go missing, the last one holds for ten seconds. Then the controller assumes
/// the worst: no headroom, and a battery that goes on discharging.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Component, Default, Clone, Debug, PartialEq))]
#[non_exhaustive]
pub struct Budget {
    /// Limit on the mean power, in watts; at least 0, infinity for no limit. While the app's meter
    /// corrects predictions, these are metered watts; else the map's, at the map's frame rate.
    ///
    /// Higher values improve quality and cost more power; lower values cost less and raise the
    /// error. Where even the cheapest settings need more, they are selected, and
    /// `Selection::status` says so.
    pub power: Option<Watts>,
    /// Limit on the mean error: 1 − SSIM against the best settings, 0 to 2; at least 0, infinity
    /// for no limit.
    ///
    /// Higher values cost less power and lower quality; lower values cost more. Single frames may
    /// exceed the limit, where error is expensive to reduce.
    pub error: Option<f64>,
    /// Time over which means are taken. Batteries, skin and a chip's own limiter react to tens of
    /// seconds.
    ///
    /// Higher values spend more where it reduces error most, and let single seconds differ more
    /// from the limit. Below 1 s every frame keeps the limits. Default: [`HORIZON`](Self::HORIZON).
    pub horizon: Duration,
    /// Limit on the power of each frame, in watts; at least 0, infinity for no limit. For devices
    /// that throttle at once. Lower values lower the quality of dear views.
    pub peak: Option<Watts>,
    /// Limit on the mean energy of the app's frames, in joules; at least 0, infinity for no limit.
    /// The cameras share it equally. It becomes power by the app's frame rate, or by the map's
    /// where no meter corrects predictions. Higher values improve quality.
    pub energy_per_frame: Option<Joules>,
    /// Limit on the time of a frame's work (`FrameTime`). Higher values improve quality; lower
    /// values raise the frame rate.
    ///
    /// The map knows no times: the controller learns while the app runs how they follow predicted
    /// power.
    pub frame_time: Option<Duration>,
    /// When the battery (`BatteryLevel`) may be empty, in real time since the app's start: for two
    /// more hours, `time.elapsed() + Duration::from_secs(7200)` of `Time<Real>`. Later times lower
    /// quality. No limit without a battery, with a charger, or after that time.
    pub battery_until: Option<Duration>,
    /// Thermal headroom (`ThermalHeadroom`) to keep, 0 to 1; 0 for no limit. Below it, the power
    /// limit falls linearly, from the best settings' power to that of the cheapest at a headroom of
    /// 0.
    ///
    /// Higher values keep the device cooler, lower values more quality.
    pub headroom: Option<f64>,
}

/// What keeps settings from being better: a limit of a [`Budget`], or another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
#[non_exhaustive]
pub enum Limit {
    /// Mean power, in watts.
    Power,
    /// Power of each frame, in watts.
    Peak,
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
    /// The camera's part of an `AppBudget`.
    AppBudget,
    /// Levels that the camera's [`KnobBounds`](super::KnobBounds) exclude.
    KnobBounds,
}

/// Invalid budget: a limit that is NaN, negative or out of its range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{limit} of {value}{unit}: give {expected}, or no limit")]
pub struct BudgetError {
    limit: &'static str,
    value: f64,
    unit: &'static str,
    expected: &'static str,
}

impl Default for Budget {
    fn default() -> Self {
        Self::new(None, None)
    }
}

impl Budget {
    /// Default of [`horizon`](Self::horizon): 30 s, about the long window of CPUs' power limiters.
    pub const HORIZON: Duration = Duration::from_secs(30);

    /// The limits that are given, in watts and as 1 − SSIM; `None` is no limit.
    pub const fn new(power: Option<Watts>, error: Option<f64>) -> Self {
        let (energy_per_frame, frame_time, battery_until, headroom) = (None, None, None, None);
        let (horizon, peak) = (Self::HORIZON, None);
        Self { power, error, horizon, peak, energy_per_frame, frame_time, battery_until, headroom }
    }

    /// Least error at a mean power of at most `power`, in watts.
    pub const fn power(power: Watts) -> Self {
        Self::new(Some(power), None)
    }

    /// Least power whose mean error is at most `error` (1 − SSIM, no unit).
    pub const fn error(error: f64) -> Self {
        Self::new(None, Some(error))
    }

    /// Both limits, in watts and as 1 − SSIM. Power takes priority where they conflict.
    pub const fn both(power: Watts, error: f64) -> Self {
        Self::new(Some(power), Some(error))
    }

    /// The same with means over `horizon`.
    #[must_use]
    pub const fn with_horizon(self, horizon: Duration) -> Self {
        Self { horizon, ..self }
    }

    /// The same with a limit on the power of each frame, in watts.
    #[must_use]
    pub const fn with_peak(self, peak: Watts) -> Self {
        Self { peak: Some(peak), ..self }
    }

    /// The same with a limit on the energy of a frame, in joules.
    #[must_use]
    pub const fn with_energy_per_frame(self, energy: Joules) -> Self {
        Self { energy_per_frame: Some(energy), ..self }
    }

    /// The same with a limit on the time of a frame's work.
    #[must_use]
    pub const fn with_frame_time(self, time: Duration) -> Self {
        Self { frame_time: Some(time), ..self }
    }

    /// The same with a time until which the battery lasts, since the app's start.
    #[must_use]
    pub const fn with_battery_until(self, until: Duration) -> Self {
        Self { battery_until: Some(until), ..self }
    }

    /// The same with a thermal headroom to keep, 0 to 1.
    #[must_use]
    pub const fn with_headroom(self, share: f64) -> Self {
        Self { headroom: Some(share), ..self }
    }

    /// Checks that each limit is at least 0, and a headroom at most 1. Infinity is valid otherwise.
    ///
    /// # Errors
    /// [`BudgetError`] for the first limit that is not, NaN included; the power limit is checked
    /// first.
    pub fn validate(&self) -> Result<(), BudgetError> {
        let (watts, joules) = ("a number of watts of 0 or more", "a number of joules of 0 or more");
        let (power, peak) = (self.power.map(|it| it.0), self.peak.map(|it| it.0));
        let energy = self.energy_per_frame.map(|it| it.0);
        let any = 0.0..=f64::INFINITY;
        for (limit, value, unit, range, expected) in [
            ("power budget", power, " W", &any, watts),
            ("peak", peak, " W", &any, watts),
            ("error budget", self.error, "", &any, "1 - SSIM as a number of 0 or more"),
            ("energy budget", energy, " J per frame", &any, joules),
            ("thermal headroom", self.headroom, " to keep", &(0.0..=1.0), "a number from 0 to 1"),
        ] {
            if let Some(value) = value.filter(|value| !range.contains(value)) {
                return Err(BudgetError { limit, value, unit, expected });
            }
        }
        Ok(())
    }
}

/// Settings of the controller, for all cameras. Times are real time: [`Duration::ZERO`] switches at
/// once, [`Duration::MAX`] never.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::resource::Resource, bevy_reflect::Reflect))]
#[cfg_attr(feature = "bevy", reflect(Resource, Default, Clone, Debug, PartialEq))]
pub struct ControlSettings {
    /// Duration of a knob's transition to its new level. Higher values change quality more gradually
    /// and follow the view and the budget later; lower values follow sooner, pass through fewer
    /// settings that are on no frontier, and change quality more visibly and more often. Default:
    /// 0.3 s; Wang et al. 2016, equation 3.8, use 2 s.
    pub transition: Duration,
    /// Shortest time between two changes of the target. It ends early when the budget cannot bear
    /// the present target, with another budget, and at a cut; small gains wait longer. Higher values
    /// change quality less often and follow views less closely. Default: 1 s.
    pub dwell: Duration,
    /// Whether the app's meter corrects predicted power: a measured one, or the modelled one that the
    /// map was made with. Default: true.
    pub power_feedback: bool,
}

impl ControlSettings {
    /// Default of [`transition`](Self::transition).
    pub const TRANSITION: Duration = Duration::from_millis(300);

    /// Seconds for which a budget must bear what settings cost: the dwell, and the transitions to them
    /// and away.
    pub fn hold_seconds(&self) -> f64 {
        self.dwell.as_secs_f64() + 2.0 * self.transition.as_secs_f64()
    }
}

impl Default for ControlSettings {
    fn default() -> Self {
        Self { transition: Self::TRANSITION, dwell: Duration::from_secs(1), power_feedback: true }
    }
}

#[cfg(test)]
#[path = "budget_tests.rs"]
mod tests;

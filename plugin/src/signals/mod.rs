//! Signals for budgets of frame time, battery and heat, which are not in watts.
//!
//! | resource | written by | holds |
//! |---|---|---|
//! | [`FrameTime`] | the app, if it knows better than its frame rate | the time of a frame's work |
//! | [`BatteryLevel`] | this module on Linux, macOS and Windows, or the app | the energy that is left, and the power drawn |
//! | [`ThermalHeadroom`] | the app | how far the device is from throttling |
//!
//! Invalid numbers, such as NaN, count as unknown.

mod battery;

use std::time::Duration;

use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

pub(crate) use battery::read_battery;
pub use battery::{BatteryLevel, BatterySettings};

/// The time that a frame's work takes, for budgets of frame time.
///
/// Without the app's own figure it is the time from frame to frame, less what
/// [`FrameRateLimit`](crate::pacing::FrameRateLimit) waits. Frames above 0.25 s count from the
/// third in succession, frames above 4 s never: the app loads, or waits for events. Vertical
/// synchronisation hides work shorter than the display's interval: with it, write the GPU's time.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct FrameTime {
    /// The last frame's work. `None`, and 0: the time from frame to frame. Default: `None`.
    pub work: Option<Duration>,
}

impl FrameTime {
    /// The app's own figure, if it is valid, in seconds.
    pub(crate) fn valid(&self) -> Option<f64> {
        self.work.filter(|work| !work.is_zero()).map(|work| work.as_secs_f64())
    }
}

/// How far the device is from throttling, as the app's platform says it.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct ThermalHeadroom {
    /// 1: cool; 0: throttling. Android's thermal headroom counts the other way round. Values beyond
    /// 0 to 1 count as the nearer end, `None` and NaN as unknown. Default: `None`.
    pub share: Option<f64>,
}

impl ThermalHeadroom {
    /// The valid share; `None` if it is unknown.
    pub(crate) fn valid(&self) -> Option<f64> {
        self.share.filter(|share| !share.is_nan()).map(|share| share.clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_share_or_unknown() {
        let of = |share| ThermalHeadroom { share: Some(share) }.valid();
        assert_eq!((of(0.4), of(-3.0), of(f64::INFINITY)), (Some(0.4), Some(0.0), Some(1.0)));
        assert_eq!((of(f64::NAN), ThermalHeadroom::default().valid()), (None, None));
    }
}

//! Signals for budgets of frame time, battery and heat, which are not in watts.
//!
//! | resource | written by | holds |
//! |---|---|---|
//! | [`FrameTime`] | the app, if it knows better than its frame rate | the time of a frame's work |
//! | [`BatteryLevel`] | this module on Linux, macOS and Windows, or the app | the energy that is left, and the power drawn |
//! | [`ThermalHeadroom`] | the app | how far the device is from throttling |
//!
//! Invalid numbers, such as NaN, count as unknown.

use std::sync::mpsc::{self, TrySendError};
use std::thread;
use std::time::Duration;

use bevy::prelude::*;

use crate::power::{Feed, feed};
use crate::units::{Joules, Watts};

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

/// Time between readings. A battery's driver may take some milliseconds, and hours pass anyway.
const INTERVAL: Duration = Duration::from_secs(5);

/// Whether the battery is read.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct BatterySettings {
    /// Whether this crate writes [`BatteryLevel`]. Set it to false to write it yourself. Default:
    /// true on Linux, macOS and Windows, where it can read the battery.
    pub enabled: bool,
}

impl Default for BatterySettings {
    fn default() -> Self {
        Self { enabled: cfg!(any(target_os = "linux", target_os = "macos", windows)) }
    }
}

/// The battery's state, for budgets of battery time. On Linux, macOS and Windows it is read every five
/// seconds from the first such budget on; elsewhere the app writes it.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct BatteryLevel {
    /// Energy that is left, in joules (a watt-hour is 3600 J); finite, at least 0. `None`: there is
    /// no battery, or a charger feeds the machine; the limit ends after ten seconds of it. An
    /// invalid number is unknown: the last energy then counts, less what was drawn since. Default:
    /// `None`.
    pub energy: Option<Joules>,
    /// Power drawn from the battery, in watts; finite, at least 0. `None`: derived from the fall of
    /// the energy. Default: `None`.
    pub power: Option<Watts>,
}

impl BatteryLevel {
    /// Energy (infinite where the battery does not feed the machine) and power, where they are
    /// valid. Warns once of invalid numbers.
    pub(crate) fn valid(&self) -> (Option<Joules>, Option<Watts>) {
        let is_valid = |value: f64| value.is_finite() && value >= 0.0;
        let energy = self.energy.filter(|energy| is_valid(energy.0));
        let power = self.power.filter(|power| is_valid(power.0));
        if energy != self.energy || power != self.power {
            warn_once!(
                "BatteryLevel of {:?}, {:?} is ignored: give joules and watts of 0 or more, or None",
                self.energy,
                self.power
            );
        }
        let is_fed = self.energy.is_none();
        (if is_fed { Some(Joules(f64::INFINITY)) } else { energy }, power)
    }
}

/// Starts a thread that reads the battery's files, since drivers may take long or hang. It ends with the
/// app, or some seconds after the receiver.
fn start_reader() -> Option<mpsc::Receiver<Option<BatteryLevel>>> {
    let (sender, levels) = mpsc::sync_channel(1);
    let work = move || {
        loop {
            let level = match feed() {
                Feed::Charger => Some(BatteryLevel::default()),
                Feed::Batteries(energy, power) => {
                    Some(BatteryLevel { energy: Some(energy), power: Some(power) })
                }
                // The last level counts, less what is drawn.
                Feed::Unknown => None,
            };
            // A level that nobody has taken yet stays; the next one replaces it in its turn.
            if let Err(TrySendError::Disconnected(_)) = sender.try_send(level) {
                return;
            }
            thread::sleep(INTERVAL);
        }
    };
    thread::Builder::new().name("frugal-gi-battery".to_owned()).spawn(work).ok()?;
    Some(levels)
}

/// Writes the level that was read, where a budget asks for it.
pub(crate) fn read_battery(
    settings: Res<BatterySettings>,
    mut level: ResMut<BatteryLevel>,
    mut reader: Local<Option<mpsc::Receiver<Option<BatteryLevel>>>>,
) {
    if !settings.enabled {
        *reader = None;
        return;
    }
    if reader.is_none() {
        *reader = start_reader();
    }
    let Some(reader) = reader.as_ref() else { return };
    if let Some(read) = reader.try_iter().flatten().last() {
        level.set_if_neq(read);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_no_energy_is_unknown() {
        let of = |value| {
            let energy = Some(Joules(value));
            BatteryLevel { energy, power: Some(Watts(value)) }.valid()
        };
        assert_eq!(of(0.0), (Some(Joules(0.0)), Some(Watts(0.0))));
        for odd in [f64::NAN, f64::INFINITY, -1.0] {
            assert_eq!(of(odd), (None, None), "{odd}");
        }
        let on_charger = BatteryLevel::default().valid();
        assert_eq!(on_charger, (Some(Joules(f64::INFINITY)), None));
    }

    #[test]
    fn it_is_a_share_or_unknown() {
        let of = |share| ThermalHeadroom { share: Some(share) }.valid();
        assert_eq!((of(0.4), of(-3.0), of(f64::INFINITY)), (Some(0.4), Some(0.0), Some(1.0)));
        assert_eq!((of(f64::NAN), ThermalHeadroom::default().valid()), (None, None));
    }
}

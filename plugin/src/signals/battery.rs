//! The energy that is left in the battery.

use std::sync::mpsc::{self, TrySendError};
use std::thread;
use std::time::Duration;

use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::{Local, Res, ResMut};
use bevy::log::warn_once;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use crate::power::{Feed, feed};
use crate::units::{Joules, Watts};

/// Time between readings. A battery's driver may take some milliseconds, and hours pass anyway.
const INTERVAL: Duration = Duration::from_secs(5);

/// Whether the battery is read.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct BatterySettings {
    /// Whether this crate writes [`BatteryLevel`]. Set it to false to write it yourself. Default:
    /// true.
    pub enabled: bool,
}

impl Default for BatterySettings {
    fn default() -> Self {
        Self { enabled: true }
    }
}

/// The battery's state, for budgets of battery time. On Linux, macOS and Windows it is read every five
/// seconds while a camera has such a budget; elsewhere the app writes it.
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

/// Reads the battery's files on a thread of its own, since drivers may take long or hang. The thread
/// ends with the app.
#[derive(Debug)]
pub(crate) struct BatteryReader {
    levels: mpsc::Receiver<Option<(Joules, Watts)>>,
    _stop: mpsc::Sender<()>,
}

impl BatteryReader {
    fn start() -> Option<Self> {
        let (sender, levels) = mpsc::sync_channel(1);
        let (stop, stopped) = mpsc::channel();
        let work = move || {
            loop {
                let level = match feed() {
                    Feed::Charger => Some(None),
                    Feed::Batteries(energy, power) => Some(Some((energy, power))),
                    // The last level counts, less what is drawn.
                    Feed::Unknown => None,
                };
                // A level that nobody has taken yet stays; the next one replaces it in its turn.
                let sent = level.map(|level| sender.try_send(level));
                if matches!(sent, Some(Err(TrySendError::Disconnected(_)))) {
                    return;
                }
                match stopped.recv_timeout(INTERVAL) {
                    Err(mpsc::RecvTimeoutError::Timeout) => {}
                    Ok(()) | Err(mpsc::RecvTimeoutError::Disconnected) => return,
                }
            }
        };
        thread::Builder::new().name("frugal-gi-battery".to_owned()).spawn(work).ok()?;
        Some(Self { levels, _stop: stop })
    }
}

/// Writes the level that was read, where a budget asks for it.
pub(crate) fn read_battery(
    settings: Res<BatterySettings>,
    mut level: ResMut<BatteryLevel>,
    mut reader: Local<Option<BatteryReader>>,
) {
    if !settings.enabled {
        *reader = None;
        return;
    }
    if reader.is_none() {
        *reader = BatteryReader::start();
    }
    let Some(reader) = reader.as_ref() else { return };
    if let Some(read) = reader.levels.try_iter().last() {
        level.set_if_neq(BatteryLevel {
            energy: read.map(|(energy, _)| energy),
            power: read.map(|(_, power)| power),
        });
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
}

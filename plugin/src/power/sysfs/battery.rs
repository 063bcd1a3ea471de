//! The machine's batteries: the power that they give while nothing else feeds the machine.
//!
//! It is the whole machine's, with display, radio and all programs. Drivers differ: power, or
//! current and voltage; above or below 0 while discharging; a new value every second or every
//! minute.

use std::path::PathBuf;
use std::time::Duration;

use super::integrate::Gauge;
use super::root::{Fault, NumberFile};
use super::{Source, SourceKind, SysRoot};
use crate::power::{Adapter, AdapterKind, MeterError, MeterInfo, Provenance};
use crate::units::{Joules, Watts};

const NAME: &str = "battery";
const FOLDER: &str = "sys/class/power_supply";
const REMEDY: &str = "give this user access to the battery's folder, in a container too";
/// Slow drivers have a new value every minute.
const STALE_AFTER: Duration = Duration::from_secs(120);

pub(crate) const KIND: SourceKind = SourceKind {
    name: NAME,
    usage: "battery[=NAME]",
    expected: "a battery's name, such as BAT0",
    find,
    find_for,
};

/// One battery of the machine.
struct Battery {
    name: String,
    status: PathBuf,
    power: NumberFile,
    current: NumberFile,
    voltage: NumberFile,
    /// Energy left: microwatt-hours, or microampere-hours.
    energy: NumberFile,
    charge: NumberFile,
}

/// All batteries, or a named one.
struct Batteries {
    root: SysRoot,
    batteries: Vec<Battery>,
    /// Of chargers: 1 while one feeds the machine.
    chargers: Vec<NumberFile>,
    gauge: Gauge,
}

fn find(root: &SysRoot, wanted: Option<&str>) -> Result<Box<dyn Source>, MeterError> {
    Ok(Box::new(batteries(root, wanted)?))
}

/// Energy left in the machine's batteries, and the power that they give; `None` unless they alone
/// feed the machine.
pub(crate) fn left(root: &SysRoot) -> Option<(Joules, Watts)> {
    let batteries = batteries(root, None).ok()?;
    let power = batteries.power().ok()?;
    let energies = batteries.batteries.iter().map(Battery::energy);
    let energy: f64 = energies.sum::<Option<f64>>()?;
    (energy.is_finite() && energy > 0.0).then_some((Joules(energy), power))
}

fn batteries(root: &SysRoot, wanted: Option<&str>) -> Result<Batteries, MeterError> {
    let (mut batteries, mut chargers) = (Vec::new(), Vec::new());
    for folder in root.list(&root.path(FOLDER), |_| true) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // A mouse has a battery, too.
        let is_machines = root.word(&folder.join("scope")).is_none_or(|scope| scope != "Device");
        match root.word(&folder.join("type")).as_deref() {
            Some("Battery") if is_machines && wanted.is_none_or(|wanted| wanted == name) => {
                batteries.push(Battery {
                    name,
                    status: folder.join("status"),
                    power: root.number(folder.join("power_now")),
                    current: root.number(folder.join("current_now")),
                    voltage: root.number(folder.join("voltage_now")),
                    energy: root.number(folder.join("energy_now")),
                    charge: root.number(folder.join("charge_now")),
                });
            }
            Some("Mains" | "USB" | "Wireless") if is_machines => {
                chargers.push(root.number(folder.join("online")));
            }
            _ => {}
        }
    }
    if batteries.is_empty() {
        let folder = root.path(FOLDER);
        let reason = match wanted {
            Some(name) => format!("no battery \"{name}\" in {}", folder.display()),
            None => format!("no battery of the machine in {}", folder.display()),
        };
        return Err(MeterError::unavailable(NAME, reason));
    }
    Ok(Batteries { root: root.clone(), batteries, chargers, gauge: Gauge::new(STALE_AFTER) })
}

fn find_for(root: &SysRoot, adapter: &Adapter) -> Result<Box<dyn Source>, MeterError> {
    suits(adapter)?;
    find(root, None)
}

/// Whether a battery is the meter to take for `adapter` where nobody names one.
pub(super) fn suits(adapter: &Adapter) -> Result<(), MeterError> {
    if adapter.kind == AdapterKind::Software {
        return Err(MeterError::unavailable(
            NAME,
            "it contains the whole machine, the CPU time of this program orders settings better; request it by name",
        ));
    }
    Ok(())
}

impl Batteries {
    /// The sum of the discharging batteries' powers.
    fn power(&self) -> Result<Watts, MeterError> {
        if self.chargers.iter().any(|charger| charger.read().is_ok_and(|online| online > 0)) {
            return Err(MeterError::unreadable(
                NAME,
                "a charger feeds the machine; a battery measures it only without one",
            ));
        }
        let mut sum = None;
        for battery in &self.batteries {
            let status = self.root.word(&battery.status);
            match status.as_deref() {
                Some("Discharging") => {
                    sum = Some(sum.unwrap_or(Watts(0.0)) + battery.power()?);
                }
                // Of two batteries one rests.
                Some("Full" | "Not charging") => {}
                Some(other) => {
                    let reason = format!(
                        "{} is {other}; a battery measures the machine only while it discharges",
                        battery.name
                    );
                    return Err(MeterError::unreadable(NAME, reason));
                }
                None => {
                    let reason = format!("{} is gone or without status", battery.name);
                    return Err(MeterError::unreadable(NAME, reason));
                }
            }
        }
        sum.ok_or_else(|| {
            MeterError::unreadable(
                NAME,
                "no battery discharges; a battery measures the machine only while it does",
            )
        })
    }
}

impl Battery {
    /// Energy left, joules.
    fn energy(&self) -> Option<f64> {
        let positive = |file: &NumberFile| file.read().ok().filter(|value| *value > 0);
        // Micro-hours to seconds.
        let unit = 3600.0 * 1e-6;
        if let Some(energy) = positive(&self.energy) {
            return Some(energy as f64 * unit);
        }
        let (charge, voltage) = (positive(&self.charge)?, positive(&self.voltage)?);
        Some(charge as f64 * unit * voltage as f64 * 1e-6)
    }

    /// The power that it gives: drivers disagree about the sign.
    fn power(&self) -> Result<Watts, MeterError> {
        let watts = match self.power.read() {
            Ok(microwatts) => microwatts as f64 * 1e-6,
            Err(fault @ (Fault::Denied | Fault::NotANumber(_))) => {
                return Err(self.power.error(NAME, fault, REMEDY));
            }
            // Many have current and voltage only, and some a file of power that never answers.
            Err(Fault::Gone | Fault::Failed(_)) => {
                let current = self.current.reading(NAME, REMEDY)?;
                let voltage = self.voltage.reading(NAME, REMEDY)?;
                let voltage = if voltage > 0 { voltage as f64 } else { f64::NAN };
                current as f64 * voltage * 1e-12
            }
        };
        if watts == 0.0 {
            let reason =
                format!("{} discharges with 0 W, which is no power of a machine", self.name);
            return Err(MeterError::broken(NAME, reason));
        }
        Ok(Watts(watts.abs()))
    }
}

impl Source for Batteries {
    fn info(&self) -> MeterInfo {
        let names: Vec<_> = self.batteries.iter().map(|battery| battery.name.as_str()).collect();
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: format!(
                "the whole machine with display and all programs, while {} discharges",
                names.join(" + ")
            ),
        }
    }

    fn window_seconds(&self) -> f64 {
        // Some values of usual drivers.
        5.0
    }

    fn poll(&self) -> Duration {
        Duration::from_secs(1)
    }

    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError> {
        let power = self.power();
        self.gauge.add(NAME, power, at)
    }
}

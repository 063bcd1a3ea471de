//! The machine's batteries: the power that they give while nothing else feeds the machine.
//!
//! It is the whole machine's, with display, radio and all programs. Drivers differ: power, or
//! current and voltage; above or below 0 while discharging; a new value every second or every
//! minute; "Unknown" for a battery at rest. The crate `starship-battery`, which reads those of other
//! systems, knows no chargers and no other root than `/sys`.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use super::files::is_numbered;
use crate::power::kind::{MeterKind, Opened, Wanted};
use crate::power::root::{Fault, SysRoot};
use crate::power::{Adapter, AdapterKind, MeterError, MeterInfo, PowerMeter, Provenance, Reading};
use crate::units::{Joules, Watts};

const NAME: &str = "battery";
const FOLDER: &str = "sys/class/power_supply";
const REMEDY: &str = "give this user access to the battery's folder, in a container too";
/// Files whose numbers change while a battery gives power.
const LIVE: [&str; 5] = ["power_now", "current_now", "voltage_now", "energy_now", "charge_now"];

pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: "battery[=NAME]",
    expected: "a battery's name, such as BAT0",
    open,
};

/// All batteries, or a named one. They are looked up for each reading, since they come and go.
struct Batteries {
    root: SysRoot,
    wanted: Option<String>,
    names: Vec<String>,
}

fn open(root: &SysRoot, wanted: Wanted) -> Opened {
    let wanted = match wanted {
        Wanted::Usual => None,
        Wanted::Named(name) => Some(name.to_owned()),
        Wanted::For(adapter) => {
            suits(adapter)?;
            None
        }
    };
    let batteries = batteries(root, wanted.as_deref())?;
    let names = batteries.into_iter().map(|battery| battery.name).collect();
    Ok(Box::new(Batteries { root: root.clone(), wanted, names }))
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

/// Energy left in the machine's batteries, and the power that they give; `None` unless they alone
/// feed the machine.
pub(crate) fn left(root: &SysRoot) -> Option<(Joules, Watts)> {
    let batteries = batteries(root, None).ok()?;
    let power = power(root, &batteries).ok()?;
    let energy: f64 = batteries.iter().map(|battery| battery.energy(root)).sum::<Option<f64>>()?;
    (energy.is_finite() && energy > 0.0).then_some((Joules(energy), power))
}

/// A battery in its bay.
struct Battery {
    name: String,
    folder: PathBuf,
}

/// What a battery does for the machine.
enum Job {
    Gives(Watts),
    /// Nothing, as it says.
    Rests(String),
}

/// Folders and types of the machine's own supplies: a mouse has a battery, too.
fn supplies(root: &SysRoot) -> impl Iterator<Item = (PathBuf, String)> {
    let folders = root.list(&root.path(FOLDER), |_| true).into_iter();
    folders.filter_map(|folder| {
        let is_machines = root.word(&folder.join("scope")).is_none_or(|scope| scope != "Device");
        let kind = root.word(&folder.join("type")).filter(|_| is_machines)?;
        Some((folder, kind))
    })
}

fn batteries(root: &SysRoot, wanted: Option<&str>) -> Result<Vec<Battery>, MeterError> {
    let mut batteries = Vec::new();
    for (folder, kind) in supplies(root) {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // Firmware lists an empty bay.
        let is_there = root.number(folder.join("present")).read() != Ok(0);
        if kind == "Battery" && is_there && wanted.is_none_or(|wanted| wanted == name) {
            batteries.push(Battery { name, folder });
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
    Ok(batteries)
}

/// Whether a supply feeds the machine. A port that feeds a phone can be online, too.
fn is_charger(root: &SysRoot, folder: &Path, kind: &str) -> bool {
    if !["Mains", "USB", "Wireless"].contains(&kind) {
        return false;
    }
    let number = |file: &str| root.number(folder.join(file)).read();
    let is_online = number("online").is_ok_and(|online| online > 0);
    let gives = root.word(&folder.join("status")).is_some_and(|status| status == "Discharging")
        || number("current_now").is_ok_and(|current| current < 0);
    is_online && !gives && !(kind == "USB" && is_source(root, folder))
}

/// Whether a port's contract is to give power.
fn is_source(root: &SysRoot, folder: &Path) -> bool {
    // "[source] sink": what stands in brackets holds, and one word holds anyway.
    let says = |file: &Path| {
        let roles = root.text(file)?;
        Some(roles.contains("[source]") || roles.trim() == "source")
    };
    if let Some(is_source) = says(&folder.join("power_role")) {
        return is_source;
    }
    let ports = root.list(&root.path("sys/class/typec"), |name| is_numbered(name, "port"));
    let roles: Vec<bool> =
        ports.iter().map(|port| says(&port.join("power_role")) == Some(true)).collect();
    // `ucsi-source-psy-USBC000:002` is that of `port1`.
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let number = name.rsplit_once(':').and_then(|(_, number)| number.parse::<usize>().ok());
    let own = number.and_then(|number| roles.get(number.checked_sub(1)?));
    own.copied().unwrap_or(!roles.is_empty() && roles.iter().all(|is_source| *is_source))
}

/// The sum of the discharging batteries' powers.
fn power(root: &SysRoot, batteries: &[Battery]) -> Result<Watts, MeterError> {
    if supplies(root).any(|(folder, kind)| is_charger(root, &folder, &kind)) {
        return Err(MeterError::unreadable(
            NAME,
            "a charger feeds the machine; a battery measures it only without one",
        ));
    }
    let (mut sum, mut resting) = (None, Vec::new());
    for battery in batteries {
        match battery.job(root, batteries.len() > 1)? {
            Job::Gives(watts) => sum = Some(sum.unwrap_or(Watts(0.0)) + watts),
            Job::Rests(how) => resting.push(format!("{} {how}", battery.name)),
        }
    }
    sum.ok_or_else(|| {
        let resting = resting.join(", ");
        let reason =
            format!("no battery feeds the machine ({resting}); one measures it only while it does");
        MeterError::unreadable(NAME, reason)
    })
}

impl Battery {
    fn number(&self, root: &SysRoot, file: &str) -> Result<i64, Fault> {
        root.number(self.folder.join(file)).read()
    }

    /// What it does; an error where it is not known, or it takes power.
    fn job(&self, root: &SysRoot, has_others: bool) -> Result<Job, MeterError> {
        let status = root.word(&self.folder.join("status"));
        match status.as_deref() {
            Some("Discharging") if has_others && self.charge(root) == Some(0.0) => {
                Ok(Job::Rests("is empty".to_owned()))
            }
            Some("Discharging") => match self.power(root)? {
                Watts(0.0) => Ok(Job::Rests("discharges with 0 W".to_owned())),
                power => Ok(Job::Gives(power)),
            },
            Some(status @ ("Full" | "Not charging")) => Ok(Job::Rests(format!("is {status}"))),
            // What drivers say of the one of two that rests.
            Some("Unknown") if self.power(root).map_or(true, |power| power.0 == 0.0) => {
                Ok(Job::Rests("is Unknown".to_owned()))
            }
            None if has_others => Ok(Job::Rests("is gone".to_owned())),
            other => {
                let is = other.map_or("gone or without status".to_owned(), str::to_owned);
                let reason = format!(
                    "{} is {is}; a battery measures the machine only while it discharges",
                    self.name
                );
                Err(MeterError::unreadable(NAME, reason))
            }
        }
    }

    /// The energy or charge left, in the driver's units.
    fn charge(&self, root: &SysRoot) -> Option<f64> {
        let charge = self.number(root, "energy_now").or_else(|_| self.number(root, "charge_now"));
        charge.ok().map(|charge| charge as f64)
    }

    /// Energy left, joules.
    fn energy(&self, root: &SysRoot) -> Option<f64> {
        // Of micro-hours, in seconds.
        let unit = 3600.0 * 1e-6;
        let valid = |value: i64| (value >= 0).then_some(value as f64);
        let charge = match (self.number(root, "energy_now"), self.number(root, "charge_now")) {
            (Ok(energy), _) => return valid(energy).map(|energy| energy * unit),
            (_, Ok(0)) => return Some(0.0),
            (_, Ok(charge)) => valid(charge)?,
            // An empty bay has neither.
            (Err(Fault::Gone), Err(Fault::Gone)) => {
                return matches!(self.job(root, true), Ok(Job::Rests(_))).then_some(0.0);
            }
            _ => return None,
        };
        let voltage = self.number(root, "voltage_now").ok().filter(|voltage| *voltage > 0)?;
        Some(charge * unit * voltage as f64 * 1e-6)
    }

    /// The power that it gives: drivers disagree about the sign.
    fn power(&self, root: &SysRoot) -> Result<Watts, MeterError> {
        let read = |file: &str| {
            let file = root.number(self.folder.join(file));
            file.read().map_err(|fault| (fault.clone(), file.error(NAME, fault, REMEDY)))
        };
        let watts = match read("power_now") {
            Ok(microwatts) => microwatts as f64 * 1e-6,
            Err((Fault::Denied | Fault::NotANumber(_), error)) => return Err(error),
            // Many have current and voltage only, and some a file of power that never answers.
            Err(_) => {
                let current = read("current_now").map_err(|(_, error)| error)?;
                let voltage = read("voltage_now").map_err(|(_, error)| error)?;
                let voltage = if voltage > 0 { voltage as f64 } else { f64::NAN };
                current as f64 * voltage * 1e-12
            }
        };
        Ok(Watts(watts.abs()))
    }
}

impl PowerMeter for Batteries {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: format!(
                "the whole machine with display and all programs, while {} discharges",
                self.names.join(" + ")
            ),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        self.read()?.energy(NAME)
    }

    fn read(&mut self) -> Result<Reading, MeterError> {
        let batteries = batteries(&self.root, self.wanted.as_deref())?;
        let power = power(&self.root, &batteries)?;
        let mut hasher = DefaultHasher::new();
        for battery in &batteries {
            LIVE.map(|file| battery.number(&self.root, file).ok()).hash(&mut hasher);
        }
        Ok(Reading::Power { power, sign_of_life: Some(hasher.finish()) })
    }

    fn window_seconds(&self) -> f64 {
        // Some values of usual drivers.
        5.0
    }

    fn poll_seconds(&self) -> f64 {
        1.0
    }
}

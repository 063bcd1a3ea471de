//! Batteries and chargers in Linux' files.
//!
//! Drivers differ: power, or current and voltage; above or below 0 while discharging; a new value
//! every second or every minute; "Unknown" for a battery at rest. The crate `starship-battery`, which
//! reads those of other systems, knows no chargers and no other root than `/sys`.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use crate::power::MeterError;
use crate::power::battery::{self, Cell, Cells, NAME, State};
use crate::power::meter::{MeterKind, Opened, Wanted};
use crate::power::root::{Fault, SysRoot};
use crate::units::{Joules, Watts};

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
pub(crate) struct Files {
    pub root: SysRoot,
    pub wanted: Option<String>,
}

fn open(root: &SysRoot, wanted: Wanted) -> Opened {
    let files = Files { root: root.clone(), wanted: battery::name(wanted)? };
    let names: Vec<String> = files.cells()?.into_iter().map(|cell| cell.name).collect();
    battery::open(Box::new(files), &names.join(" + "))
}

impl Cells for Files {
    fn read(&mut self) -> Result<Vec<Cell>, MeterError> {
        if self.supplies().any(|(folder, kind)| self.is_charger(&folder, &kind)) {
            let reason = "a charger feeds the machine; a battery measures it only without one";
            return Err(MeterError::unreadable(NAME, reason));
        }
        self.cells()
    }

    fn times(&self) -> [f64; 2] {
        [1.0, 5.0]
    }
}

impl Files {
    /// Folders and types of the machine's own supplies: a mouse has a battery, too.
    fn supplies(&self) -> impl Iterator<Item = (PathBuf, String)> {
        let folders = self.root.list(&self.root.path(FOLDER), |_| true).into_iter();
        folders.filter_map(|folder| {
            let scope = self.root.word(&folder.join("scope"));
            let is_machines = scope.is_none_or(|scope| scope != "Device");
            let kind = self.root.word(&folder.join("type")).filter(|_| is_machines)?;
            Some((folder, kind))
        })
    }

    fn number(&self, folder: &Path, file: &str) -> Result<i64, Fault> {
        self.root.number(folder.join(file)).read()
    }

    fn cells(&self) -> Result<Vec<Cell>, MeterError> {
        let mut cells = Vec::new();
        for (folder, kind) in self.supplies() {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            // Firmware lists an empty bay.
            let is_there = self.number(&folder, "present") != Ok(0);
            let is_wanted = self.wanted.as_ref().is_none_or(|wanted| *wanted == name);
            if kind == "Battery" && is_there && is_wanted {
                cells.push(self.cell(&folder, name));
            }
        }
        if cells.is_empty() {
            let folder = self.root.path(FOLDER);
            let reason = match &self.wanted {
                Some(name) => format!("no battery \"{name}\" in {}", folder.display()),
                None => format!("no battery of the machine in {}", folder.display()),
            };
            return Err(MeterError::unavailable(NAME, reason));
        }
        Ok(cells)
    }

    fn cell(&self, folder: &Path, name: String) -> Cell {
        let status = self.root.word(&folder.join("status"));
        let state = match status.as_deref() {
            Some("Discharging") => State::Discharging,
            Some("Full" | "Not charging") => State::Resting,
            Some("Charging") => State::Charging,
            Some(_) => State::Unknown,
            None => State::Gone,
        };
        let mut hasher = DefaultHasher::new();
        LIVE.map(|file| self.number(folder, file).ok()).hash(&mut hasher);
        Cell {
            name,
            state,
            power: self.power(folder),
            energy: self.energy(folder, state).map(Joules),
            said: status.unwrap_or_else(|| "gone, or without status".to_owned()),
            sign_of_life: hasher.finish(),
        }
    }

    /// Energy left, joules.
    fn energy(&self, folder: &Path, state: State) -> Option<f64> {
        // Of micro-hours, in seconds.
        let unit = 3600.0 * 1e-6;
        let valid = |value: i64| (value >= 0).then_some(value as f64);
        let read = |file: &str| self.number(folder, file);
        let charge = match (read("energy_now"), read("charge_now")) {
            (Ok(energy), _) => return valid(energy).map(|energy| energy * unit),
            (_, Ok(0)) => return Some(0.0),
            (_, Ok(charge)) => valid(charge)?,
            // An empty bay has neither.
            (Err(Fault::Gone), Err(Fault::Gone)) if state != State::Discharging => {
                return Some(0.0);
            }
            _ => return None,
        };
        let voltage = read("voltage_now").ok().filter(|voltage| *voltage > 0)?;
        Some(charge * unit * voltage as f64 * 1e-6)
    }

    fn power(&self, folder: &Path) -> Result<Watts, MeterError> {
        let read = |file: &str| {
            let file = self.root.number(folder.join(file));
            file.read().map_err(|fault| (fault.clone(), file.error(NAME, fault, REMEDY)))
        };
        match read("power_now") {
            Ok(microwatts) => Ok(Watts(microwatts as f64 * 1e-6)),
            Err((Fault::Denied | Fault::NotANumber(_), error)) => Err(error),
            // Many have current and voltage only, and some a file of power that never answers.
            Err(_) => {
                let current = read("current_now").map_err(|(_, error)| error)?;
                let voltage = read("voltage_now").map_err(|(_, error)| error)?;
                let voltage = if voltage > 0 { voltage as f64 } else { f64::NAN };
                Ok(Watts(current as f64 * voltage * 1e-12))
            }
        }
    }

    /// Whether a supply feeds the machine. A port that feeds a phone can be online, too.
    fn is_charger(&self, folder: &Path, kind: &str) -> bool {
        let is_online = self.number(folder, "online").is_ok_and(|online| online > 0);
        let status = self.root.word(&folder.join("status"));
        let gives = status.is_some_and(|status| status == "Discharging")
            || self.number(folder, "current_now").is_ok_and(|current| current < 0)
            || (kind == "USB" && self.is_source(folder));
        ["Mains", "USB", "Wireless"].contains(&kind) && is_online && !gives
    }

    /// Whether a port's contract is to give power.
    fn is_source(&self, folder: &Path) -> bool {
        // "[source] sink": what stands in brackets holds, and one word holds anyway.
        let says = |file: &Path| {
            let roles = self.root.text(file)?;
            Some(roles.contains("[source]") || roles.trim() == "source")
        };
        if let Some(is_source) = says(&folder.join("power_role")) {
            return is_source;
        }
        let ports = self.root.numbered(&self.root.path("sys/class/typec"), "port");
        let roles: Vec<bool> =
            ports.iter().map(|port| says(&port.join("power_role")) == Some(true)).collect();
        // `ucsi-source-psy-USBC000:002` is that of `port1`.
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let number = name.rsplit_once(':').and_then(|(_, number)| number.parse::<usize>().ok());
        let own = number.and_then(|number| roles.get(number.checked_sub(1)?));
        own.copied().unwrap_or(!roles.is_empty() && roles.iter().all(|is_source| *is_source))
    }
}

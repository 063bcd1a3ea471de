//! The machine's batteries: the power that they give while nothing else feeds the machine. It is the
//! whole machine's, with display, radio and all programs.
//!
//! All that can go wrong is decided from plain data ([`Cell`]). On Linux it comes from files
//! (`sysfs/battery.rs`), elsewhere from the system's interface (`notebook.rs`).

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::power::meter::{Opened, Wanted};
use crate::power::{AdapterKind, MeterError, MeterInfo, PowerMeter, Provenance, Reading};
use crate::units::{Joules, Watts};

/// Name of the meter.
pub(crate) const NAME: &str = "battery";

/// What a battery does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Discharging,
    /// Full, or held below that: it neither gives nor takes.
    Resting,
    Charging,
    Unknown,
    /// Taken out.
    Gone,
}

/// A battery, as the system describes it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cell {
    pub name: String,
    pub state: State,
    /// The state in the system's words.
    pub said: String,
    /// Systems and drivers disagree about the sign.
    pub power: Result<Watts, MeterError>,
    /// Energy left; `None` where unknown.
    pub energy: Option<Joules>,
    /// Changes with every number that the system says of it.
    pub sign_of_life: u64,
}

/// What the system says of its batteries.
pub(crate) trait Cells: Send {
    /// All batteries of the machine, or those that were named.
    ///
    /// # Errors
    /// When there is none, the system does not answer, or a charger feeds the machine.
    fn read(&mut self) -> Result<Vec<Cell>, MeterError>;

    /// Time between two values, and of some of them, seconds.
    fn times(&self) -> [f64; 2];
}

/// The meter.
struct Batteries {
    cells: Box<dyn Cells>,
    description: String,
}

/// Opens the meter of `cells`, called `names`.
pub(crate) fn open(cells: Box<dyn Cells>, names: &str) -> Opened {
    let description =
        format!("the whole machine with display and all programs, while {names} discharges");
    Ok(Box::new(Batteries { cells, description }))
}

/// The name after `=`, and whether batteries are the meter to take where nobody names one.
pub(crate) fn name(wanted: Wanted) -> Result<Option<String>, MeterError> {
    match wanted {
        Wanted::Usual => Ok(None),
        Wanted::Named(name) => Ok(Some(name.to_owned())),
        Wanted::For(adapter) if adapter.kind == AdapterKind::Software => {
            let reason = "it contains the whole machine, the CPU time of this program orders settings better; request it by name";
            Err(MeterError::unavailable(NAME, reason))
        }
        Wanted::For(_) => Ok(None),
    }
}

/// What feeds the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Feed {
    /// A charger; or there is no battery.
    Charger,
    /// Batteries alone, with the energy that is left in them and the power that they give.
    Batteries(Joules, Watts),
    /// Their figures are missing or make no sense.
    Unknown,
}

/// What feeds a machine with these batteries.
pub(crate) fn feed_of(cells: &[Cell]) -> Feed {
    if cells.iter().any(|cell| cell.state == State::Charging) {
        return Feed::Charger;
    }
    let energy = cells.iter().map(|cell| Some(cell.energy?.0)).sum::<Option<f64>>();
    match (power_of(cells), energy) {
        (Ok(power), Some(energy)) if energy.is_finite() && energy > 0.0 => {
            Feed::Batteries(Joules(energy), power)
        }
        (Err(_), _) if cells.iter().all(|it| matches!(it.state, State::Resting | State::Gone)) => {
            Feed::Charger
        }
        _ => Feed::Unknown,
    }
}

/// The sum of the discharging batteries' powers.
pub(crate) fn power_of(cells: &[Cell]) -> Result<Watts, MeterError> {
    let (mut sum, mut resting) = (None, Vec::new());
    for cell in cells {
        match given(cell, cells.len() > 1)? {
            Some(power) => sum = Some(sum.unwrap_or(Watts(0.0)) + power),
            None if cell.state == State::Discharging => {
                resting.push(format!("{} is {} with 0 W", cell.name, cell.said));
            }
            None => resting.push(format!("{} is {}", cell.name, cell.said)),
        }
    }
    sum.ok_or_else(|| {
        let resting = resting.join(", ");
        let reason = format!(
            "no battery gives power ({resting}); it measures the machine only while one does"
        );
        MeterError::unreadable(NAME, reason)
    })
}

/// The power that a battery gives, `None` while it rests; an error where it may take power.
fn given(cell: &Cell, has_others: bool) -> Result<Option<Watts>, MeterError> {
    let is_empty = cell.energy == Some(Joules(0.0));
    match (cell.state, &cell.power) {
        (State::Resting, _) => Ok(None),
        (State::Gone, _) if has_others => Ok(None),
        // Some tell of an empty one what it last gave.
        (State::Discharging, _) if has_others && is_empty => Ok(None),
        // What drivers say of the one of two that rests.
        (State::Discharging | State::Unknown, Ok(Watts(0.0))) | (State::Unknown, Err(_)) => {
            Ok(None)
        }
        (State::Discharging, Ok(power)) => Ok(Some(Watts(power.0.abs()))),
        (State::Discharging, Err(error)) => Err(error.clone()),
        (State::Charging | State::Unknown | State::Gone, _) => {
            let reason = format!(
                "{} is {}; it measures the machine only while it discharges",
                cell.name, cell.said
            );
            Err(MeterError::unreadable(NAME, reason))
        }
    }
}

impl PowerMeter for Batteries {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: self.description.clone(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        self.read()?.energy(NAME)
    }

    fn read(&mut self) -> Result<Reading, MeterError> {
        let cells = self.cells.read()?;
        let power = power_of(&cells)?;
        let mut hasher = DefaultHasher::new();
        cells.iter().for_each(|cell| cell.sign_of_life.hash(&mut hasher));
        Ok(Reading::Power { power, sign_of_life: Some(hasher.finish()) })
    }

    fn window_seconds(&self) -> f64 {
        self.cells.times()[1]
    }

    fn poll_seconds(&self) -> f64 {
        self.cells.times()[0]
    }
}

//! Batteries of macOS and Windows, by the crate `starship-battery`: the power that they give while
//! nothing else feeds the machine.
//!
//! There are no files to fake on these systems. What a machine says of its batteries is therefore
//! plain data ([`Cell`]), from which everything follows that can be wrong; only the few lines that ask
//! the system are not tested, and they are compiled with the tests on every system.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::battery::suits;
use crate::power::kind::{MeterKind, Opened, Wanted};
use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance, Reading};
use crate::units::{Joules, Watts};

const NAME: &str = "battery";

/// Meter kind of these systems; there is one machine, and all of its batteries count.
#[cfg_attr(not(any(windows, target_os = "macos")), expect(dead_code, reason = "Linux has files"))]
pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: NAME,
    expected: "nothing: all batteries count",
    open: |_, wanted| open(wanted),
};

/// What a battery does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Discharging,
    /// Full, or held below that: it neither gives nor takes.
    Resting,
    Charging,
    Unknown,
}

/// A battery, as the system describes it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    state: State,
    /// Systems disagree about the sign.
    power: Watts,
    energy: Joules,
}

/// What the system says of its batteries.
trait Cells: Send {
    /// All batteries of the machine.
    ///
    /// # Errors
    /// The system's message.
    fn read(&mut self) -> Result<Vec<Cell>, String>;
}

/// The system's own interface. Opened for each reading: its handle does not pass between threads on
/// every system.
struct System;

impl Cells for System {
    fn read(&mut self) -> Result<Vec<Cell>, String> {
        use starship_battery::units::{energy::joule, power::watt};
        let manager = starship_battery::Manager::new().map_err(|error| error.to_string())?;
        let batteries = manager.batteries().map_err(|error| error.to_string())?;
        let cell = |battery: starship_battery::Battery| Cell {
            state: match battery.state() {
                starship_battery::State::Discharging => State::Discharging,
                starship_battery::State::Charging => State::Charging,
                starship_battery::State::Full
                | starship_battery::State::Paused
                | starship_battery::State::Empty => State::Resting,
                starship_battery::State::Unknown => State::Unknown,
            },
            power: Watts(battery.energy_rate().get::<watt>().into()),
            energy: Joules(battery.energy().get::<joule>().into()),
        };
        batteries.map(|battery| battery.map(cell).map_err(|error| error.to_string())).collect()
    }
}

/// All batteries of the machine.
struct Notebook {
    cells: Box<dyn Cells>,
}

fn open(wanted: Wanted) -> Opened {
    match wanted {
        Wanted::Usual => {}
        Wanted::Named(name) => {
            let reason = format!("batteries have no names on this system: leave out \"={name}\"");
            return Err(MeterError::unavailable(NAME, reason).into());
        }
        Wanted::For(adapter) => suits(adapter)?,
    }
    Ok(Box::new(notebook(Box::new(System))?))
}

fn notebook(mut cells: Box<dyn Cells>) -> Result<Notebook, MeterError> {
    let found = cells.read().map_err(|reason| MeterError::unavailable(NAME, reason))?;
    if found.is_empty() {
        return Err(MeterError::unavailable(NAME, "this machine has no battery"));
    }
    Ok(Notebook { cells })
}

/// Energy left in the machine's batteries, and the power that they give; `None` unless they alone
/// feed the machine.
#[cfg_attr(not(any(windows, target_os = "macos")), expect(dead_code, reason = "Linux has files"))]
pub(crate) fn left() -> Option<(Joules, Watts)> {
    left_in(&System.read().ok()?)
}

fn left_in(cells: &[Cell]) -> Option<(Joules, Watts)> {
    let power = power_of(cells).ok()?;
    let energy: f64 = cells.iter().map(|cell| cell.energy.0).sum();
    (energy.is_finite() && energy > 0.0).then_some((Joules(energy), power))
}

/// Power of the machine by its batteries.
fn power_of(cells: &[Cell]) -> Result<Watts, MeterError> {
    let mut sum = None;
    for cell in cells {
        match cell.state {
            // Of two batteries one rests, whatever it says.
            State::Resting => {}
            State::Discharging | State::Unknown if cell.power.0 == 0.0 => {}
            State::Discharging => {
                sum = Some(sum.unwrap_or(Watts(0.0)) + Watts(cell.power.0.abs()));
            }
            State::Charging | State::Unknown => {
                return Err(MeterError::unreadable(
                    NAME,
                    format!(
                        "a battery's state is {:?}; it measures the machine only while it discharges",
                        cell.state
                    ),
                ));
            }
        }
    }
    sum.ok_or_else(|| {
        MeterError::unreadable(
            NAME,
            "no battery feeds the machine; one measures it only while it does",
        )
    })
}

impl PowerMeter for Notebook {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description:
                "the whole machine with display and all programs, while its battery discharges"
                    .to_owned(),
        }
    }

    fn window_seconds(&self) -> f64 {
        // Some values of usual systems.
        60.0
    }

    fn poll_seconds(&self) -> f64 {
        2.0
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        self.read()?.energy(NAME)
    }

    fn read(&mut self) -> Result<Reading, MeterError> {
        let cells = self.cells.read();
        let cells = cells.map_err(|reason| MeterError::unreadable(NAME, reason))?;
        let power = power_of(&cells)?;
        let mut hasher = DefaultHasher::new();
        let bits = |cell: &Cell| (cell.power.0.to_bits(), cell.energy.0.to_bits());
        cells.iter().map(bits).collect::<Vec<_>>().hash(&mut hasher);
        Ok(Reading::Power { power, sign_of_life: Some(hasher.finish()) })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::power::MeterState;
    use crate::power::root::SysRoot;
    use crate::power::tracker::{Moment, PowerTracker};

    /// Answers one after the other, and the last for ever.
    struct Scripted(Vec<Result<Vec<Cell>, String>>);

    impl Cells for Scripted {
        fn read(&mut self) -> Result<Vec<Cell>, String> {
            if self.0.len() > 1 { self.0.remove(0) } else { self.0[0].clone() }
        }
    }

    fn cell(state: State, watts: f64) -> Cell {
        Cell { state, power: Watts(watts), energy: Joules(1000.0) }
    }

    /// Energy or message of each reading, one every two seconds.
    fn readings(script: Vec<Result<Vec<Cell>, String>>) -> Vec<Result<Joules, String>> {
        let count = script.len() as u32;
        let mut script = script;
        // The first answer is read when it is opened.
        script.insert(0, script[0].clone());
        let mut meter = notebook(Box::new(Scripted(script))).expect("a battery");
        let poll = Duration::from_secs(2);
        let mut tracker = PowerTracker::new(&meter, poll, Duration::ZERO);
        (0..count)
            .map(|step| {
                let at = Moment { clock: poll * step, ..Moment::default() };
                tracker.push(meter.read(), at);
                match &tracker.snapshot().state {
                    MeterState::Lost { reason } => Err(reason.clone()),
                    _ => Ok(tracker.snapshot().counted.0),
                }
            })
            .collect()
    }

    #[test]
    fn the_power_of_discharging_batteries_adds_up_whatever_its_sign() {
        let two = |watts| Ok(vec![cell(State::Discharging, watts), cell(State::Resting, 0.0)]);
        let found = readings(vec![two(-10.0), two(10.0), two(-10.0), two(-12.0)]);
        // The first two seconds only say how much is usual.
        assert_eq!(found.last(), Some(&Ok(Joules(42.0))), "{found:?}");
        let cells = [cell(State::Discharging, 4.0), cell(State::Discharging, -3.0)];
        assert_eq!(left_in(&cells), Some((Joules(2000.0), Watts(7.0))));
        assert_eq!(left_in(&[cell(State::Charging, 4.0)]), None);
        assert_eq!(left_in(&[]), None);
    }

    #[test]
    fn no_fault_is_a_false_watt() {
        let good = || Ok(vec![cell(State::Discharging, 10.0)]);
        let faults: Vec<Result<Vec<Cell>, String>> = vec![
            Ok(vec![cell(State::Charging, 10.0)]),
            Ok(vec![cell(State::Resting, 0.0)]),
            Ok(vec![cell(State::Unknown, 10.0)]),
            Ok(vec![cell(State::Discharging, 0.0)]),
            Ok(vec![cell(State::Discharging, f64::NAN)]),
            Ok(vec![cell(State::Discharging, f64::INFINITY)]),
            Ok(vec![cell(State::Discharging, 1e6)]),
            Ok(Vec::new()),
            Err("access denied".to_owned()),
        ];
        for fault in faults {
            let mut script = vec![good(); 8];
            script[3] = fault.clone();
            let found = readings(script);
            assert!(found[3].is_err(), "{fault:?}: {found:?}");
            // Ten watts for two seconds three times, and none for the time of the fault.
            assert_eq!(found[7], Ok(Joules(60.0)), "{fault:?}: {found:?}");
        }
    }

    #[test]
    fn a_machine_without_a_battery_has_no_such_meter() {
        for (script, said) in [(Ok(Vec::new()), "no battery"), (Err("denied".to_owned()), "denied")]
        {
            let error = notebook(Box::new(Scripted(vec![script]))).err().expect("no meter");
            assert!(error.to_string().contains(said), "{error}");
        }
        let named =
            (KIND.open)(&SysRoot::default(), Wanted::Named("BAT0")).err().expect("no names");
        assert!(named.to_string().contains("leave out"), "{named}");
        // This machine's own, by the same lines as on other systems: any answer, and no panic.
        let _ = System.read();
    }
}

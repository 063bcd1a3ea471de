//! Batteries of macOS and Windows, by the crate `starship-battery`. There are no files to fake on these
//! systems: the few lines that ask the system are not tested, but compiled with the tests everywhere.

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::power::MeterError;
use crate::power::battery::{self, Cell, Cells, NAME, State};
use crate::power::meter::{MeterKind, Opened, Wanted};
use crate::units::{Joules, Watts};

/// Meter kind of these systems; there is one machine, and all of its batteries count.
pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: NAME,
    expected: "nothing: all batteries count",
    open: |_, wanted| open(wanted, System),
};

/// The system's own interface. Opened for each reading: its handle does not pass between threads on
/// every system.
pub(crate) struct System;

fn open(wanted: Wanted, mut cells: impl Cells + 'static) -> Opened {
    if let Some(name) = battery::name(wanted)? {
        let reason = format!("batteries have no names on this system: leave out \"={name}\"");
        return Err(MeterError::unavailable(NAME, reason).into());
    }
    cells.read()?;
    battery::open(Box::new(cells), "its battery")
}

impl Cells for System {
    fn read(&mut self) -> Result<Vec<Cell>, MeterError> {
        let failed =
            |error: starship_battery::Error| MeterError::unreadable(NAME, error.to_string());
        let manager = starship_battery::Manager::new().map_err(failed)?;
        let batteries = manager.batteries().map_err(failed)?;
        let cells = batteries.map(|battery| Ok(cell(&battery.map_err(failed)?)));
        let cells = cells.collect::<Result<Vec<Cell>, MeterError>>()?;
        if cells.is_empty() {
            return Err(MeterError::unavailable(NAME, "this machine has no battery"));
        }
        Ok(cells)
    }

    fn times(&self) -> [f64; 2] {
        // Windows and macOS have a new value at least every minute.
        [2.0, 60.0]
    }
}

fn cell(battery: &starship_battery::Battery) -> Cell {
    use starship_battery::units::{energy::joule, power::watt};
    let power: f64 = battery.energy_rate().get::<watt>().into();
    let energy: f64 = battery.energy().get::<joule>().into();
    let mut hasher = DefaultHasher::new();
    [power.to_bits(), energy.to_bits()].hash(&mut hasher);
    Cell {
        name: "a battery".to_owned(),
        state: match battery.state() {
            starship_battery::State::Discharging => State::Discharging,
            starship_battery::State::Charging => State::Charging,
            starship_battery::State::Full
            | starship_battery::State::Paused
            | starship_battery::State::Empty => State::Resting,
            starship_battery::State::Unknown => State::Unknown,
        },
        said: battery.state().to_string(),
        power: Ok(Watts(power)),
        energy: Some(Joules(energy)),
        sign_of_life: hasher.finish(),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::power::MeterState;
    use crate::power::battery::Feed;
    use crate::power::root::SysRoot;
    use crate::power::tracker::{Moment, PowerTracker};

    /// Answers one after the other, and the last for ever.
    struct Scripted(Vec<Answer>);

    type Answer = Result<Vec<Cell>, MeterError>;

    impl Cells for Scripted {
        fn read(&mut self) -> Answer {
            if self.0.len() > 1 { self.0.remove(0) } else { self.0[0].clone() }
        }

        fn times(&self) -> [f64; 2] {
            System.times()
        }
    }

    fn cell(state: State, watts: f64) -> Cell {
        Cell {
            name: "a battery".to_owned(),
            state,
            said: format!("{state:?}"),
            power: Ok(Watts(watts)),
            energy: Some(Joules(1000.0)),
            sign_of_life: 0,
        }
    }

    /// Energy or message of each reading, one every two seconds.
    fn readings(script: Vec<Answer>) -> Vec<Result<Joules, String>> {
        let count = script.len() as u32;
        let mut script = script;
        // The first answer is read when it is opened.
        script.insert(0, script[0].clone());
        let mut meter = open(Wanted::Usual, Scripted(script)).expect("a battery");
        let poll = Duration::from_secs(2);
        let mut tracker = PowerTracker::new(meter.as_ref(), poll, Duration::ZERO);
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
        assert_eq!(battery::feed_of(&cells), Feed::Batteries(Joules(2000.0), Watts(7.0)));
        assert_eq!(battery::feed_of(&[cell(State::Charging, 4.0)]), Feed::Charger);
        assert_eq!(battery::feed_of(&[]), Feed::Charger);
        assert_eq!(battery::feed_of(&[cell(State::Unknown, 0.0)]), Feed::Unknown);
    }

    #[test]
    fn no_fault_is_a_false_watt() {
        let good = || Ok(vec![cell(State::Discharging, 10.0)]);
        let faults: Vec<Answer> = vec![
            Ok(vec![cell(State::Charging, 10.0)]),
            Ok(vec![cell(State::Resting, 0.0)]),
            Ok(vec![cell(State::Unknown, 10.0)]),
            Ok(vec![cell(State::Discharging, 0.0)]),
            Ok(vec![cell(State::Discharging, f64::NAN)]),
            Ok(vec![cell(State::Discharging, f64::INFINITY)]),
            Ok(vec![cell(State::Discharging, 1e6)]),
            Ok(Vec::new()),
            Err(MeterError::unreadable(NAME, "access denied")),
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
        let denied = Err(MeterError::unreadable(NAME, "denied"));
        let error = open(Wanted::Usual, Scripted(vec![denied])).err().expect("no meter");
        assert!(error.to_string().contains("denied"), "{error}");
        let named =
            (KIND.open)(&SysRoot::default(), Wanted::Named("BAT0")).err().expect("no names");
        assert!(named.to_string().contains("leave out"), "{named}");
        // This machine's own, by the same lines as on other systems: any answer, and no panic.
        let _ = System.read();
    }
}

//! A meter on a fake clock, on a machine of known power.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;
use std::time::Duration;

use super::super::testing::Tree;
use super::variants::{Reads, Variant};
use crate::power::meter::{SaidFaults, Wanted, least_window};
use crate::power::tracker::{Moment, PowerTracker};
use crate::power::{MeterState, PowerMeter};

/// Range of the true power, watts.
pub(super) const LOW: f64 = 16.0;
pub(super) const HIGH: f64 = 24.0;

/// What readings may be without a fault, watts.
pub(super) const TRUE: RangeInclusive<f64> = LOW * 0.99..=HIGH * 1.01;

/// A meter that is polled on a fake clock.
pub(super) struct Play {
    pub variant: Variant,
    pub tree: Tree,
    pub meter: Box<dyn PowerMeter>,
    pub tracker: PowerTracker,
    /// Seconds from reading to reading.
    tick: f64,
    /// Seconds awake, and asleep on a clock that stands still then.
    pub at: f64,
    pub slept: f64,
    /// Joules of the machine.
    pub joules: f64,
    /// Joules that a counter reads more than the machine has drawn.
    pub offset: f64,
    /// Factor of the machine's power, and of what a sensor says of it.
    pub load: f64,
    pub lie: f64,
    /// Seconds from update to update of the files; 0: always.
    pub update: f64,
    pub updated: f64,
    /// A folder that was renamed.
    renamed: Option<(&'static str, &'static str)>,
    /// Every reading, watts.
    pub readings: Vec<f64>,
    /// Every reading must be in here.
    pub allowed: RangeInclusive<f64>,
    said: SaidFaults,
    pub warnings: Vec<String>,
}

impl Play {
    pub(super) fn new(variant: Variant, offset: f64) -> Self {
        Self::on(Tree::of(variant.files), variant, offset)
    }

    fn on(tree: Tree, variant: Variant, offset: f64) -> Self {
        write(&tree, variant, None, (0.0 + offset, (LOW + HIGH) * 0.5));
        let wanted = variant.parameter.map_or(Wanted::Usual, Wanted::Named);
        let opened = (variant.kind.open)(&tree.root(), wanted);
        let meter = opened.unwrap_or_else(|error| panic!("{}: {error}", variant.name));
        let window = least_window(meter.as_ref()).as_secs_f64();
        let tick = meter.poll_seconds().min(window.max(0.25));
        let poll = Duration::from_secs_f64(tick);
        Self {
            variant,
            tree,
            tracker: PowerTracker::new(meter.as_ref(), poll, Duration::from_secs(2)),
            meter,
            tick,
            at: 0.0,
            slept: 0.0,
            joules: 0.0,
            offset,
            load: 1.0,
            lie: 1.0,
            update: 0.0,
            updated: 0.0,
            renamed: None,
            readings: Vec::new(),
            allowed: TRUE,
            said: SaidFaults::default(),
            warnings: Vec::new(),
        }
    }

    /// One that has run for half a minute.
    pub(super) fn started(variant: Variant, offset: f64) -> Self {
        let mut play = Self::new(variant, offset);
        play.run(30.0, true);
        assert!(!play.readings.is_empty(), "{} has no reading", variant.name);
        assert_eq!(play.warnings, [""; 0], "{}", variant.name);
        play
    }

    pub(super) fn watts(&self) -> f64 {
        let swing = 0.5 * (HIGH - LOW) * (self.at * TAU / 7.0).sin();
        self.load * (0.5 * (LOW + HIGH) + swing)
    }

    pub(super) fn write(&self) {
        let values = (self.joules + self.offset, self.watts() * self.lie);
        write(&self.tree, self.variant, self.renamed, values);
    }

    /// The driver comes back with another number.
    pub(super) fn rename(&mut self, from: &'static str, to: &'static str) {
        self.tree.rename(from, to);
        self.renamed = Some((from, to));
    }

    /// Polls for `seconds`; the machine updates its files if `is_alive`.
    pub(super) fn run(&mut self, seconds: f64, is_alive: bool) -> &mut Self {
        for _ in 0..(seconds / self.tick).round() as usize {
            // The machine's power in small steps.
            for _ in 0..10 {
                self.joules += self.watts() * self.tick / 10.0;
                self.at += self.tick / 10.0;
                if is_alive && self.update > 0.0 && self.at >= self.updated + self.update - 1e-9 {
                    self.updated = self.at;
                    self.write();
                }
            }
            if is_alive && self.update == 0.0 {
                self.write();
            }
            self.poll(self.at);
        }
        self
    }

    pub(super) fn poll(&mut self, at: f64) {
        let clock = Duration::from_secs_f64(at);
        let before = self.tracker.snapshot().sample_count;
        let answer = self.meter.read();
        let slept = Duration::from_secs_f64(self.slept);
        self.tracker.push(answer, Moment { clock, slept });
        let snapshot = self.tracker.snapshot();
        assert_eq!(snapshot.latest.is_some(), snapshot.state == MeterState::Running);
        assert_eq!(snapshot.mean.is_some(), snapshot.state == MeterState::Running);
        if let MeterState::Lost { reason } = &snapshot.state
            && self.said.is_new(reason, clock)
        {
            self.warnings.push(reason.clone());
        }
        if let (Some(watts), Some(mean)) = (snapshot.latest, snapshot.mean)
            && snapshot.sample_count > before
        {
            let name = self.variant.name;
            for figure in [watts, mean] {
                assert!(
                    self.allowed.contains(&figure.0),
                    "{name}: {watts}, {mean} in the mean at {} s",
                    self.at
                );
            }
            self.readings.push(watts.0);
        }
    }

    /// The file of the power that fails.
    pub(super) fn main(&self) -> String {
        let path = self.variant.live[0].0;
        self.renamed.map_or(path.to_owned(), |(from, to)| path.replacen(from, to, 1))
    }

    pub(super) fn assert_lost(&self, fault: &str, words: &[&str]) {
        let name = self.variant.name;
        let MeterState::Lost { reason } = &self.tracker.snapshot().state else {
            panic!("{name}, {fault}: {:?}", self.tracker.snapshot());
        };
        assert!(words.iter().any(|word| reason.contains(word)), "{name}, {fault}: {reason}");
    }

    /// Runs on with good files, and there must be good readings, and no further warning.
    pub(super) fn assert_returns(&mut self, fault: &str) {
        let before = self.readings.len();
        self.run(20.0, true);
        let name = self.variant.name;
        assert_eq!(self.tracker.snapshot().state, MeterState::Running, "{name} after {fault}");
        assert!(self.readings.len() > before, "{name} after {fault}");
        assert!(self.warnings.len() <= 1, "{name}, {fault}: {:?}", self.warnings);
    }

    pub(super) fn assert_mean(&self, fault: &str) {
        let mean = self.readings.iter().sum::<f64>() / self.readings.len() as f64;
        let is_close = (mean / (0.5 * (LOW + HIGH)) - 1.0).abs() < 0.05;
        assert!(is_close, "{}, {fault}: {mean} W in the mean", self.variant.name);
    }

    pub(super) fn is_running(&self) -> bool {
        self.tracker.snapshot().state == MeterState::Running
    }
}

/// Writes the files of a power: joules so far, and watts.
fn write(
    tree: &Tree,
    variant: Variant,
    renamed: Option<(&str, &str)>,
    (joules, watts): (f64, f64),
) {
    for (path, reads) in variant.live {
        let value = match reads {
            Reads::Energy(share, range) => ((joules * 1e6 * share) as i64).rem_euclid(*range),
            Reads::Power(units) => (watts * units).round() as i64,
        };
        let path = renamed.map_or((*path).to_owned(), |(from, to)| path.replacen(from, to, 1));
        tree.write(&path, &value.to_string());
    }
}

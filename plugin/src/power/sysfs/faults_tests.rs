//! Every kind of meter with every fault, on fake trees and a fake clock: none ever says a false
//! watt.

use std::f64::consts::TAU;

use super::fake::Tree;
use super::*;
use crate::power::tracker::PowerTracker;
use crate::power::window::least_window;
use crate::power::{MeterState, PowerMeter};
use crate::units::Watts;

/// Seconds from reading to reading.
const TICK: f64 = 0.25;
/// Range of the true power, watts.
const LOW: f64 = 16.0;
const HIGH: f64 = 24.0;

/// A kind of meter with the files that it reads.
#[derive(Clone, Copy)]
struct Variant {
    name: &'static str,
    kind: &'static SourceKind,
    parameter: Option<&'static str>,
    /// Files that stay, with traps among them.
    files: &'static [(&'static str, &'static str)],
    /// Files of the power, with what they read: the first one fails.
    live: &'static [(&'static str, Reads)],
    is_counter: bool,
}

/// What a file reads.
#[derive(Clone, Copy)]
enum Reads {
    /// Microjoules: a share of the energy, modulo a range.
    Energy(f64, i64),
    /// Units per watt.
    Power(f64),
}

const RANGE: i64 = 262_143_328_850;

const VARIANTS: &[Variant] = &[
    Variant {
        name: "rapl, one package",
        kind: &rapl::KIND,
        parameter: None,
        files: &[
            ("sys/class/powercap/intel-rapl:0/name", "package-0"),
            ("sys/class/powercap/intel-rapl:0/max_energy_range_uj", "262143328850"),
            ("sys/class/powercap/intel-rapl:0:0/name", "core"),
            ("sys/class/powercap/intel-rapl:0:0/energy_uj", "5"),
            ("sys/class/powercap/intel-rapl:1/name", "psys"),
            ("sys/class/powercap/intel-rapl:1/energy_uj", "5"),
            ("sys/class/powercap/intel-rapl-mmio:0/name", "package-0"),
            ("sys/class/powercap/intel-rapl-mmio:0/energy_uj", "5"),
        ],
        live: &[("sys/class/powercap/intel-rapl:0/energy_uj", Reads::Energy(1.0, RANGE))],
        is_counter: true,
    },
    Variant {
        name: "rapl, two packages",
        kind: &rapl::KIND,
        parameter: Some("package"),
        files: &[
            ("sys/class/powercap/intel-rapl:0/name", "package-0"),
            ("sys/class/powercap/intel-rapl:0/max_energy_range_uj", "262143328850"),
            ("sys/class/powercap/intel-rapl:1/name", "package-1"),
            ("sys/class/powercap/intel-rapl:1/max_energy_range_uj", "65532610987"),
        ],
        live: &[
            ("sys/class/powercap/intel-rapl:1/energy_uj", Reads::Energy(0.25, 65_532_610_987)),
            ("sys/class/powercap/intel-rapl:0/energy_uj", Reads::Energy(0.75, RANGE)),
        ],
        is_counter: true,
    },
    Variant {
        name: "rapl, platform",
        kind: &rapl::KIND,
        parameter: Some("psys"),
        files: &[
            ("sys/class/powercap/intel-rapl:0/name", "package-0"),
            ("sys/class/powercap/intel-rapl:0/energy_uj", "5"),
            ("sys/class/powercap/intel-rapl:1/name", "psys"),
            ("sys/class/powercap/intel-rapl:1/max_energy_range_uj", "262143328850"),
        ],
        live: &[("sys/class/powercap/intel-rapl:1/energy_uj", Reads::Energy(1.0, RANGE))],
        is_counter: true,
    },
    Variant {
        name: "amdgpu, average",
        kind: &gpu::AMD,
        parameter: None,
        files: &[
            ("sys/class/drm/card1/device/vendor", "0x1002"),
            ("sys/class/drm/card1/device/hwmon/hwmon4/name", "amdgpu"),
            ("sys/class/drm/card1-eDP-1/device/vendor", "0x1002"),
        ],
        live: &[("sys/class/drm/card1/device/hwmon/hwmon4/power1_average", Reads::Power(1e6))],
        is_counter: false,
    },
    Variant {
        name: "amdgpu, input beside an average that never answers",
        kind: &gpu::AMD,
        parameter: Some("0000:c1:00.0"),
        files: &[
            ("sys/class/drm/card0/device/vendor", "0x1002"),
            ("sys/class/drm/card0/device/uevent", "DRIVER=amdgpu\nPCI_SLOT_NAME=0000:c1:00.0"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/name", "amdgpu"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/power1_average", "0"),
            ("sys/class/drm/card1/device/vendor", "0x1002"),
        ],
        live: &[("sys/class/drm/card0/device/hwmon/hwmon2/power1_input", Reads::Power(1e6))],
        is_counter: false,
    },
    Variant {
        name: "xe, card and package",
        kind: &gpu::INTEL,
        parameter: Some("card0"),
        files: &[
            ("sys/class/drm/card0/device/vendor", "0x8086"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/name", "xe"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/energy1_label", "pkg"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/energy2_label", "card"),
        ],
        live: &[
            ("sys/class/drm/card0/device/hwmon/hwmon2/energy2_input", Reads::Energy(1.0, 1 << 32)),
            ("sys/class/drm/card0/device/hwmon/hwmon2/energy1_input", Reads::Energy(0.7, 1 << 32)),
        ],
        is_counter: true,
    },
    Variant {
        name: "i915, card and tile",
        kind: &gpu::INTEL,
        parameter: None,
        files: &[
            ("sys/class/drm/card0/device/vendor", "0x8086"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/name", "i915_gt0"),
            ("sys/class/drm/card0/device/hwmon/hwmon3/name", "i915"),
        ],
        live: &[
            ("sys/class/drm/card0/device/hwmon/hwmon3/energy1_input", Reads::Energy(1.0, 1 << 32)),
            ("sys/class/drm/card0/device/hwmon/hwmon2/energy1_input", Reads::Energy(0.7, 1 << 32)),
        ],
        is_counter: true,
    },
    Variant {
        name: "battery, power",
        kind: &battery::KIND,
        parameter: None,
        files: &[
            ("sys/class/power_supply/AC/type", "Mains"),
            ("sys/class/power_supply/AC/online", "0"),
            ("sys/class/power_supply/BAT0/type", "Battery"),
            ("sys/class/power_supply/BAT0/status", "Discharging"),
            ("sys/class/power_supply/hid-mouse/type", "Battery"),
            ("sys/class/power_supply/hid-mouse/scope", "Device"),
            ("sys/class/power_supply/hid-mouse/status", "Charging"),
        ],
        live: &[("sys/class/power_supply/BAT0/power_now", Reads::Power(1e6))],
        is_counter: false,
    },
    Variant {
        name: "battery, power below 0",
        kind: &battery::KIND,
        parameter: Some("BAT1"),
        files: &[
            ("sys/class/power_supply/BAT0/type", "Battery"),
            ("sys/class/power_supply/BAT0/status", "Charging"),
            ("sys/class/power_supply/BAT1/type", "Battery"),
            ("sys/class/power_supply/BAT1/status", "Discharging"),
        ],
        live: &[("sys/class/power_supply/BAT1/power_now", Reads::Power(-1e6))],
        is_counter: false,
    },
    Variant {
        name: "battery, current below 0 and voltage",
        kind: &battery::KIND,
        parameter: None,
        files: &[
            ("sys/class/power_supply/BAT0/type", "Battery"),
            ("sys/class/power_supply/BAT0/status", "Discharging"),
            ("sys/class/power_supply/BAT0/voltage_now", "12500000"),
        ],
        live: &[("sys/class/power_supply/BAT0/current_now", Reads::Power(-1e6 / 12.5))],
        is_counter: false,
    },
    Variant {
        name: "two batteries, one at rest",
        kind: &battery::KIND,
        parameter: None,
        files: &[
            ("sys/class/power_supply/BAT0/type", "Battery"),
            ("sys/class/power_supply/BAT0/status", "Discharging"),
            ("sys/class/power_supply/BAT1/type", "Battery"),
            ("sys/class/power_supply/BAT1/status", "Not charging"),
            ("sys/class/power_supply/BAT1/power_now", "0"),
        ],
        live: &[("sys/class/power_supply/BAT0/power_now", Reads::Power(1e6))],
        is_counter: false,
    },
    Variant {
        name: "jetson, VDD_IN",
        kind: &jetson::KIND,
        parameter: None,
        files: &[
            ("sys/class/hwmon/hwmon0/name", "nvme"),
            ("sys/class/hwmon/hwmon1/name", "ina3221"),
            ("sys/class/hwmon/hwmon1/in1_label", "VDD_CPU_GPU_CV"),
            ("sys/class/hwmon/hwmon1/in1_input", "5000"),
            ("sys/class/hwmon/hwmon1/curr1_input", "900"),
            ("sys/class/hwmon/hwmon1/in2_label", "VDD_IN"),
            ("sys/class/hwmon/hwmon1/in2_input", "19000"),
        ],
        live: &[("sys/class/hwmon/hwmon1/curr2_input", Reads::Power(1e3 / 19.0))],
        is_counter: false,
    },
    Variant {
        name: "jetson, POM_5V_IN",
        kind: &jetson::KIND,
        parameter: None,
        files: &[
            ("sys/class/hwmon/hwmon1/name", "ina3221"),
            ("sys/class/hwmon/hwmon1/in1_label", "POM_5V_IN"),
            ("sys/class/hwmon/hwmon1/curr1_input", "-4000"),
            ("sys/class/hwmon/hwmon1/in1_input", "5000"),
            ("sys/class/hwmon/hwmon1/in2_label", "POM_5V_GPU"),
        ],
        live: &[("sys/class/hwmon/hwmon1/curr1_input", Reads::Power(200.0))],
        is_counter: false,
    },
];

/// A meter that is polled on a fake clock, on a machine of known power.
struct Play {
    variant: Variant,
    tree: Tree,
    source: Box<dyn Source>,
    tracker: PowerTracker,
    /// Seconds and joules of the machine.
    at: f64,
    joules: f64,
    /// Joules that a counter reads more than the machine has drawn.
    offset: f64,
    /// Seconds from update to update of the files.
    update: f64,
    updated: f64,
    /// Every reading, watts.
    readings: Vec<f64>,
    /// Every reading must be in here.
    allowed: std::ops::RangeInclusive<f64>,
}

impl Play {
    fn new(variant: Variant, offset: f64) -> Self {
        let tree = Tree::of(variant.files);
        let mut play = Self {
            variant,
            source: Box::new(Nothing),
            tracker: PowerTracker::new(Nothing.info(), Watts(0.0), Duration::ZERO, Duration::ZERO),
            tree,
            at: 0.0,
            joules: 0.0,
            offset,
            update: 0.0,
            updated: 0.0,
            readings: Vec::new(),
            allowed: LOW * 0.99..=HIGH * 1.01,
        };
        play.write();
        let source = (variant.kind.find)(&play.tree.root(), variant.parameter);
        play.source = source.unwrap_or_else(|error| panic!("{}: {error}", variant.name));
        let window = Duration::from_secs_f64(play.source.window_seconds());
        play.tracker = PowerTracker::new(play.source.info(), Watts(0.0), window, Duration::ZERO);
        play
    }

    fn watts(&self) -> f64 {
        0.5 * (LOW + HIGH) + 0.5 * (HIGH - LOW) * (self.at * TAU / 7.0).sin()
    }

    fn write(&self) {
        for (path, reads) in self.variant.live {
            let value = match reads {
                Reads::Energy(share, range) => {
                    (((self.joules + self.offset) * 1e6 * share) as i64).rem_euclid(*range)
                }
                Reads::Power(units) => (self.watts() * units).round() as i64,
            };
            self.tree.write(path, &value.to_string());
        }
    }

    /// Polls for `seconds`; the machine updates its files if `is_alive`.
    fn run(&mut self, seconds: f64, is_alive: bool) -> &mut Self {
        for _ in 0..(seconds / TICK).round() as usize {
            // The machine's power in small steps.
            for _ in 0..10 {
                self.joules += self.watts() * TICK / 10.0;
                self.at += TICK / 10.0;
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

    fn poll(&mut self, at: f64) {
        let at = Duration::from_secs_f64(at);
        let before = self.tracker.snapshot().sample_count;
        let answer = self.source.energy_at(at).and_then(|energy| {
            energy.ok_or_else(|| MeterError::unreadable("test", "the update is awaited"))
        });
        self.tracker.push(answer, at);
        let snapshot = self.tracker.snapshot();
        assert_eq!(snapshot.latest.is_some(), snapshot.state == MeterState::Running);
        if let (Some(watts), true) = (snapshot.latest, snapshot.sample_count > before) {
            let name = self.variant.name;
            assert!(self.allowed.contains(&watts.0), "{name}: {watts} at {} s", self.at);
            self.readings.push(watts.0);
        }
    }

    fn main(&self) -> &'static str {
        self.variant.live[0].0
    }

    fn assert_lost(&self, fault: &str, words: &[&str]) {
        let name = self.variant.name;
        let MeterState::Lost { reason } = &self.tracker.snapshot().state else {
            panic!("{name}, {fault}: {:?}", self.tracker.snapshot());
        };
        assert!(words.iter().any(|word| reason.contains(word)), "{name}, {fault}: {reason}");
    }

    /// Runs on with good files, and there must be good readings.
    fn assert_returns(&mut self, fault: &str) {
        let before = self.readings.len();
        self.run(12.0, true);
        let name = self.variant.name;
        assert_eq!(self.tracker.snapshot().state, MeterState::Running, "{name} after {fault}");
        assert!(self.readings.len() > before, "{name} after {fault}");
    }

    fn assert_mean(&self, fault: &str) {
        let mean = self.readings.iter().sum::<f64>() / self.readings.len() as f64;
        let is_close = (mean / (0.5 * (LOW + HIGH)) - 1.0).abs() < 0.05;
        assert!(is_close, "{}, {fault}: {mean} W in the mean", self.variant.name);
    }
}

/// In place of a source that is yet to be found.
struct Nothing;

impl Source for Nothing {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: "none".to_owned(),
            provenance: crate::power::Provenance::Measured,
            description: String::new(),
        }
    }

    fn window_seconds(&self) -> f64 {
        0.0
    }

    fn poll(&self) -> Duration {
        Duration::ZERO
    }

    fn energy_at(&mut self, _: Duration) -> Result<Option<Joules>, MeterError> {
        Ok(None)
    }
}

#[test]
fn no_fault_of_any_meter_is_a_false_watt() {
    let mut count = 0;
    for variant in VARIANTS {
        let started = |offset| {
            let mut play = Play::new(*variant, offset);
            play.run(20.0, true);
            assert!(!play.readings.is_empty(), "{} has no reading", variant.name);
            play
        };
        let mut play = started(0.0);
        play.run(50.0, true).assert_mean("steady");
        count += 1;

        // Files that deny, vanish or tell no power: lost with the reason, and back with the file.
        let mut texts = vec![("N/A", "no number"), ("", "no number"), ("1e3", "no number")];
        texts.push(("99999999999999999999999999", "no number"));
        texts.push(("9000000000000000000", if variant.is_counter { "jumped" } else { "reads" }));
        if variant.is_counter {
            texts.push(("-5000000", "reads -5000000"));
        } else {
            texts.push(("0", "0 W"));
            if variant.kind.name != "battery" {
                texts.push(("-5000", "reads"));
            }
        }
        for (text, word) in texts {
            let mut play = started(0.0);
            play.tree.write(play.main(), text);
            play.run(5.0, false);
            // A counter that jumped once stands still thereafter.
            let words = [word, "did not move", "awaited"];
            play.assert_lost(text, &words[..if variant.is_counter { 3 } else { 1 }]);
            play.assert_returns(text);
            count += 1;
        }
        let mut play = started(0.0);
        play.tree.deny(play.main(), true);
        play.run(5.0, true).assert_lost("denied", &["permission denied"]);
        play.tree.deny(play.main(), false);
        play.assert_returns("denied");
        let mut play = started(0.0);
        play.tree.remove(play.main());
        play.run(5.0, false).assert_lost("vanished", &["gone"]);
        play.assert_returns("vanished");
        count += 2;

        // Stuck, and back with all that was missed.
        let mut play = started(0.0);
        let before = play.readings.len();
        play.allowed = 0.0..=HIGH * 1.01;
        play.run(130.0, false).assert_lost("stuck", &["did not move", "it has read"]);
        let said: Vec<f64> = play.readings.drain(before..).collect();
        assert!(!variant.is_counter || said.len() <= 1, "{}: {said:?}", variant.name);
        // A power that stays is one for some time: what it last was.
        assert!(said.iter().all(|watts| *watts >= LOW * 0.99), "{}: {said:?}", variant.name);
        play.allowed = LOW * 0.99..=HIGH * 1.01;
        play.assert_returns("stuck");
        count += 1;

        // Staircases: single readings are as uncertain as the step, the mean is not.
        for update in [0.1, 0.5, 1.0, 2.0] {
            let mut play = Play::new(*variant, 0.0);
            (play.update, play.allowed) = (update, LOW * 0.5..=HIGH * 1.6);
            play.run(70.0, true).assert_mean("staircase");
            assert_eq!(play.tracker.snapshot().state, MeterState::Running);
            count += 1;
        }

        let mut play = started(0.0);
        play.poll(play.at - 5.0);
        play.assert_returns("time backwards");
        let mut play = started(0.0);
        // Asleep: nobody polls, and the machine draws nothing.
        play.at += 3600.0;
        play.allowed = 0.0..=HIGH * 1.01;
        play.run(TICK, true);
        play.allowed = LOW * 0.99..=HIGH * 1.01;
        play.assert_returns("an hour without a poll");
        count += 2;

        if variant.is_counter {
            // Wraps 100 J after the start, within the first seconds, and is steady.
            for (_, reads) in variant.live {
                let Reads::Energy(share, range) = reads else { continue };
                let mut play = started(*range as f64 * 1e-6 / share - 500.0);
                play.run(30.0, true).assert_mean("wrap");
                assert_eq!(play.tracker.snapshot().dropped_count, 0);
                count += 1;
            }
            let mut play = started(1000.0);
            play.offset = -play.joules;
            play.assert_returns("reset");
            count += 1;
            // A reset shortly before a wrap looks like one, of four times the power.
            let Reads::Energy(share, range) = variant.live[0].1 else { continue };
            let mut play = started(range as f64 * 1e-6 / share - 420.0);
            play.offset = -play.joules;
            play.assert_returns("reset before a wrap");
            count += 1;
        }
        if variant.kind.name == "battery" {
            let bat = play.main().rsplit_once('/').expect("a folder").0;
            for status in ["Charging", "Unknown", "Full"] {
                let mut play = started(0.0);
                play.tree.write(&format!("{bat}/status"), status);
                play.run(5.0, true).assert_lost(status, &[status, "no battery discharges"]);
                play.tree.write(&format!("{bat}/status"), "Discharging");
                play.assert_returns(status);
                count += 1;
            }
        }
    }
    println!("    {} meters, {count} cases", VARIANTS.len());
    assert!(VARIANTS.len() >= 8 && count >= 50, "{count}");
}

#[test]
fn what_a_meter_covers_is_in_its_provenance() {
    let told: Vec<String> =
        VARIANTS.iter().map(|variant| Play::new(*variant, 0.0).source.info().description).collect();
    let has = |place: usize, words: &[&str]| {
        assert!(words.iter().all(|word| told[place].contains(word)), "{}", told[place]);
    };
    has(1, &["package-0 + package-1", "all programs"]);
    has(4, &["0000:c1:00.0", "power1_input"]);
    has(5, &["whole card", "energy2_input"]);
    has(7, &["whole machine with display", "BAT0 discharges"]);
    has(11, &["whole module", "VDD_IN"]);
}

#[test]
fn a_charger_that_feeds_the_machine_too_stops_the_battery_meter() {
    let mut play = Play::new(VARIANTS[7], 0.0);
    play.run(20.0, true);
    play.tree.write("sys/class/power_supply/AC/online", "1");
    play.run(2.0, true).assert_lost("charger", &["charger feeds"]);
    play.tree.write("sys/class/power_supply/AC/online", "0");
    play.assert_returns("charger");
}

#[test]
fn a_module_without_an_input_rail_is_refused_with_its_rails() {
    let tree = Tree::of(&[
        ("sys/class/hwmon/hwmon1/name", "ina3221"),
        ("sys/class/hwmon/hwmon1/in1_label", "VDD_GPU_SOC"),
        ("sys/class/hwmon/hwmon1/in2_label", "VDD_SYS_CPU"),
    ]);
    let refusal = |rail| (jetson::KIND.find)(&tree.root(), rail).err().expect("no input rail");
    let message = refusal(None).to_string();
    assert!(message.contains("VDD_GPU_SOC, VDD_SYS_CPU"), "{message}");
    assert!(refusal(Some("VDD")).to_string().contains("no rail \"VDD\""));
}

#[cfg(unix)]
#[test]
fn a_file_that_hangs_is_lost_in_seconds_and_comes_back() {
    let variant = VARIANTS[11];
    let play = Play::new(variant, 0.0);
    let opened = variant.kind.open(&play.tree.root(), None);
    let mut meter = opened.expect("a meter");
    let window = least_window(meter.as_ref());
    assert_eq!(window, Duration::from_secs(1));
    let energy = |meter: &mut dyn PowerMeter| meter.energy();
    assert!(energy(meter.as_mut()).is_ok());
    // A pipe that nobody writes to never opens.
    let path = play.tree.path(play.main());
    std::fs::remove_file(&path).expect("a file");
    let made = std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo");
    assert!(made.success());
    let start = std::time::Instant::now();
    let waits = || start.elapsed() < Duration::from_secs(20);
    while waits() && !energy(meter.as_mut()).is_err_and(|e| e.to_string().contains("answered")) {}
    assert!(waits(), "it hangs");
    // A writer that says nothing ends the reader.
    drop(std::fs::OpenOptions::new().write(true).open(&path).expect("a pipe"));
    std::fs::remove_file(&path).expect("a pipe");
    play.write();
    while waits() && energy(meter.as_mut()).is_err() {
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(waits(), "it answers again");
}

#[test]
fn the_energy_left_is_that_of_the_machines_batteries_while_they_feed_it() {
    let tree = Tree::of(&[
        ("sys/class/power_supply/BAT0/type", "Battery"),
        ("sys/class/power_supply/BAT0/status", "Discharging"),
        ("sys/class/power_supply/BAT0/power_now", "-9000000"),
        ("sys/class/power_supply/BAT0/energy_now", "20000000"),
        ("sys/class/power_supply/BAT1/type", "Battery"),
        ("sys/class/power_supply/BAT1/status", "Full"),
        ("sys/class/power_supply/BAT1/voltage_now", "10000000"),
        ("sys/class/power_supply/BAT1/charge_now", "1500000"),
    ]);
    let left = || battery::left(&tree.root()).map(|(energy, power)| (energy.0.round(), power.0));
    assert_eq!(left(), Some((35.0 * 3600.0, 9.0)), "20 Wh and 1.5 Ah at 10 V");
    for text in ["0", "-5", "unknown", ""] {
        tree.write("sys/class/power_supply/BAT1/charge_now", text);
        assert_eq!(left(), None, "{text}");
    }
    tree.write("sys/class/power_supply/BAT1/charge_now", "1500000");
    tree.write("sys/class/power_supply/BAT0/status", "Charging");
    assert_eq!(left(), None);
}

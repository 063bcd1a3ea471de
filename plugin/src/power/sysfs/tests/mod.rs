//! The fault matrix: every kind of meter with every fault that it can have, on fake trees and a fake
//! clock. No reading is false, each fault is said once, and the state is honest.

mod batteries;
mod play;
mod variants;

use std::time::{Duration, Instant};

use super::jetson;
use super::testing::{Tree, opened};
use crate::power::meter::Wanted;
use crate::power::{MeterState, PowerSampler, SamplerSettings};

use play::{HIGH, LOW, Play, TRUE};
use variants::{Reads, VARIANTS, Variant};

/// Errors of Linux, with what is said of them.
const ERRORS: [(i32, &str); 5] =
    [(1, "not permitted"), (5, "error"), (13, "permission denied"), (16, "busy"), (61, "No data")];

/// Plays a fault on every meter that `can` have it.
fn each(can: impl Fn(&Variant) -> bool, fault: &str, play: impl Fn(&mut Play, &str)) {
    let meters: Vec<_> = VARIANTS.iter().filter(|variant| can(variant)).collect();
    for variant in &meters {
        play(&mut Play::started(**variant, 3000.0), fault);
    }
    assert!(!meters.is_empty());
    println!("fault matrix: {:3} meters, {fault}", meters.len());
}

fn any(_: &Variant) -> bool {
    true
}

#[test]
fn a_meter_without_a_fault_is_right_and_silent() {
    assert!(VARIANTS.len() >= 17);
    each(any, "none", |play, fault| {
        play.run(50.0, true).assert_mean(fault);
        assert!(play.is_running() && play.warnings.is_empty());
    });
}

/// A driver that is loaded again has other numbers: lost with the reason, found again, and described
/// as before.
#[test]
fn a_device_with_another_number_is_found_again() {
    each(
        |variant| !variant.renames.is_empty(),
        "renumbered",
        |play, fault| {
            let [(from, to)] = play.variant.renames else { panic!("one folder") };
            let before = play.meter.info();
            play.rename(from, to);
            play.run(5.0, true);
            // Batteries have no numbers of their own: they are looked up each time.
            let warnings = usize::from(!play.variant.is_battery());
            assert_eq!(play.warnings.len(), warnings, "{}: {:?}", play.variant.name, play.warnings);
            play.assert_returns(fault);
            assert_eq!(play.meter.info(), before, "two starts of the machine have one text");
        },
    );
}

/// Files that deny, vanish or tell no power: lost with the reason, and back with the file.
#[test]
fn a_file_that_tells_nothing_loses_the_meter_until_it_does() {
    let is_file = |variant: &Variant| variant.kind.name != "nvml";
    for text in ["N/A", "", "1e3", "NaN", "inf", "99999999999999999999999999"] {
        let can = |variant: &Variant| is_file(variant) || text == "NaN" || text == "inf";
        each(can, text, |play, fault| {
            play.tree.write(&play.main(), fault);
            play.run(5.0, false).assert_lost(fault, &["no number", "the counter reads"]);
            play.assert_returns(fault);
        });
    }
    each(
        |v| !v.is_counter(),
        "5e12 W",
        |play, fault| {
            play.tree.write(&play.main(), "9000000000000000000");
            play.run(5.0, false).assert_lost(fault, &["reads"]);
            play.assert_returns(fault);
        },
    );
    each(
        |v| !v.is_counter(),
        "0 W",
        |play, fault| {
            if play.variant.live.len() > 1 {
                play.variant.live.iter().for_each(|(path, _)| play.tree.write(path, "0"));
            }
            play.tree.write(&play.main(), "0");
            play.run(5.0, false).assert_lost(fault, &["0 W"]);
            play.assert_returns(fault);
        },
    );
    let has_sign = |v: &Variant| !v.is_battery() && is_file(v);
    each(has_sign, "below 0", |play, fault| {
        play.tree.write(&play.main(), "-5000000");
        play.run(5.0, false).assert_lost(fault, &["reads"]);
        play.assert_returns(fault);
    });
    for (number, word) in ERRORS {
        each(is_file, word, |play, fault| {
            play.tree.fail(&play.main(), Some(number));
            let main = play.main();
            let has_other = main.ends_with("power_now") && number != 13;
            let is_card = play.variant.is_card();
            // What the driver answers for a card that sleeps.
            let words: &[&str] = match number {
                _ if has_other => &["current_now is gone"],
                1 | 16 | 61 if is_card => &["the GPU sleeps"],
                _ => &[word],
            };
            play.run(5.0, true).assert_lost(fault, words);
            play.tree.fail(&main, None);
            play.assert_returns(fault);
        });
    }
    each(any, "gone", |play, fault| {
        play.tree.remove(&play.main());
        play.run(5.0, false).assert_lost(fault, &["gone"]);
        play.assert_returns(fault);
    });
}

#[test]
fn what_stands_still_is_lost_where_that_is_a_fault() {
    // Stuck, and back with all that was missed.
    each(
        |v| v.is_counter() || v.is_battery(),
        "stuck",
        |play, fault| {
            let before = play.readings.len();
            play.allowed = 0.0..=HIGH * 1.01;
            play.run(150.0, false).assert_lost(fault, &["did not move", "say the same"]);
            let said: Vec<f64> = play.readings.drain(before..).collect();
            assert!(!play.variant.is_counter() || said.len() <= 1, "{said:?}");
            // A power that stays is one for some time: what it last was.
            assert!(said.iter().all(|watts| *watts >= LOW * 0.99), "{said:?}");
            play.run(600.0, false).assert_lost(fault, &["did not move", "say the same"]);
            play.allowed = TRUE;
            play.assert_returns(fault);
        },
    );
    each(
        |v| v.live.len() > 1 && v.is_counter() && v.kind.name == "rapl",
        "one of two stuck",
        |play, fault| {
            let stuck = std::fs::read_to_string(play.tree.path(&play.main())).expect("a file");
            play.allowed = 0.0..=HIGH * 1.01;
            for _ in 0..80 {
                play.tree.write(&play.main(), &stuck);
                play.write();
                play.tree.write(&play.main(), &stuck);
                play.run(0.25, false);
            }
            play.assert_lost(fault, &["did not move"]);
            play.allowed = TRUE;
            play.assert_returns(fault);
        },
    );
    // Sensors in whole watts read the same for minutes.
    each(
        |v| !v.is_counter() && !v.is_battery(),
        "whole watts",
        |play, _| {
            play.run(600.0, false);
            assert!(play.is_running() && play.warnings.is_empty());
        },
    );
    each(Variant::is_battery, "a steady power of a battery that empties", |play, _| {
        let bat = play.main().rsplit_once('/').expect("a folder").0.to_owned();
        for second in 0..600 {
            play.tree.write(&format!("{bat}/energy_now"), &(20_000_000 - second * 100).to_string());
            play.run(1.0, false);
        }
        assert!(play.is_running() && play.warnings.is_empty());
    });
}

#[test]
fn steps_are_no_faults_and_loads_are_told_in_seconds() {
    // Staircases: single readings are as uncertain as the step, the mean is not.
    for update in [0.1, 0.5, 1.0, 2.0] {
        each(any, &format!("steps of {update} s"), |play, fault| {
            (play.update, play.updated) = (update, play.at);
            play.allowed = LOW * 0.5..=HIGH * 1.6;
            play.run(10.0, true);
            play.readings.clear();
            play.run(70.0, true).assert_mean(fault);
            assert!(play.is_running() && play.warnings.is_empty(), "{}", play.variant.name);
        });
    }
    // A load that stays is told within seconds, and nothing above it.
    for load in [3.0, 15.0, 0.1] {
        each(any, &format!("{load} times the load"), |play, fault| {
            play.load = load;
            play.allowed = LOW * 0.99 * load.min(1.0)..=HIGH * 1.01 * load.max(1.0);
            let window = play.meter.window_seconds();
            play.run(2.0 * window + 3.5, true);
            let last = play.readings.last().expect("a reading");
            let is_there = (LOW * 0.9..=HIGH * 1.1).contains(&(last / load));
            assert!(is_there, "{}, {fault}: {last} W", play.variant.name);
            play.run(30.0, true);
            play.load = 1.0;
            play.assert_returns(fault);
            assert!(play.warnings.is_empty());
        });
    }
    // Bursts of three seconds' time make a mean, not nothing.
    each(
        |v| v.kind.name == "amdgpu",
        "bursts",
        |play, fault| {
            play.allowed = LOW * 0.9..=HIGH * 6.0;
            for _ in 0..60 {
                play.load = 6.0;
                play.run(0.2, true);
                play.load = 1.0;
                play.run(0.3, true);
            }
            let last = &play.readings[play.readings.len() - 10..];
            let mean = last.iter().sum::<f64>() / 10.0;
            assert!(mean > 20.0 * 2.0, "{}, {fault}: {mean} W, 60 W in truth", play.variant.name);
        },
    );
}

#[test]
fn a_jump_or_fall_is_no_power() {
    let is_counter = |v: &Variant| v.is_counter();
    // Up, and back a second later, one second in five.
    for joules in [30.0, 702.0, 60_000.0] {
        each(is_counter, &format!("{joules} J up and back"), |play, fault| {
            let before = play.readings.len();
            for _ in 0..12 {
                play.offset += joules;
                play.run(1.0, true);
                play.offset -= joules;
                play.run(4.0, true);
            }
            let count = play.readings.len() - before;
            assert!(count >= 12, "{}, {fault}: {count} readings", play.variant.name);
            play.assert_returns(fault);
            assert!(play.warnings.is_empty(), "{:?}", play.warnings);
        });
        each(is_counter, &format!("{joules} J up once"), |play, fault| {
            play.offset += joules;
            play.assert_returns(fault);
            assert!(play.warnings.is_empty(), "{:?}", play.warnings);
        });
    }
    each(
        |v| !v.is_counter() && !v.is_battery(),
        "one reading of 30 times",
        |play, fault| {
            for _ in 0..6 {
                play.lie = 30.0;
                play.run(0.3, true);
                play.lie = 1.0;
                play.run(5.0, true);
            }
            play.assert_returns(fault);
            assert!(play.warnings.is_empty(), "{:?}", play.warnings);
        },
    );
    each(Variant::is_battery, "one reading of 30 times", |play, fault| {
        play.lie = 30.0;
        play.run(1.0, true);
        play.lie = 1.0;
        play.assert_returns(fault);
        assert!(play.warnings.is_empty(), "{:?}", play.warnings);
    });
    each(is_counter, "keeps falling", |play, fault| {
        for _ in 0..20 {
            play.offset -= 100.0;
            play.run(play.meter.window_seconds().max(0.25), true);
        }
        play.assert_lost(fault, &["fell"]);
        play.assert_returns(fault);
    });
    each(is_counter, "reset", |play, fault| {
        play.offset = -play.joules;
        play.assert_returns(fault);
    });
    let wraps = |v: &Variant| v.is_counter() && v.kind.name != "nvml";
    // Some 100 J after the start each of the counters wraps, and is steady.
    each(wraps, "wrap", |play, fault| {
        for (_, reads) in play.variant.live {
            let Reads::Energy(share, range) = reads else { continue };
            let mut play = Play::started(play.variant, *range as f64 * 1e-6 / share - 800.0);
            play.run(30.0, true).assert_mean(fault);
            assert_eq!(play.tracker.snapshot().dropped_count, 0);
        }
    });
    // A reset shortly before a wrap looks like one, of four times the power.
    each(wraps, "reset before a wrap", |play, fault| {
        let Reads::Energy(share, range) = play.variant.live[0].1 else { return };
        let mut play = Play::started(play.variant, range as f64 * 1e-6 / share - 620.0);
        play.offset = -play.joules;
        play.assert_returns(fault);
    });
    each(any, "time backwards", |play, fault| {
        play.poll(play.at - 5.0);
        play.assert_returns(fault);
    });
}

/// The machine sleeps for ten minutes, at 0.7 W.
#[test]
fn no_power_is_told_of_a_sleep() {
    each(any, "sleep, the clock stands", |play, fault| {
        play.slept += 600.0;
        play.joules += 420.0;
        play.assert_returns(fault);
        assert!(play.warnings.is_empty());
    });
    each(any, "sleep, the clock runs on", |play, fault| {
        play.at += 600.0;
        play.joules += 420.0;
        play.assert_returns(fault);
        assert!(play.warnings.is_empty());
    });
    each(Variant::is_counter, "sleep, and nothing tells it", |play, fault| {
        play.joules += 420.0;
        play.assert_returns(fault);
        assert!(play.warnings.is_empty());
    });
    each(any, "short sleeps", |play, fault| {
        for _ in 0..20 {
            play.slept += 3.0;
            play.joules += 2.0;
            play.run(12.0, true);
        }
        play.assert_returns(fault);
        assert!(play.warnings.is_empty());
    });
    let can_stick = |v: &Variant| v.is_counter() || v.is_battery();
    each(can_stick, "stuck after a sleep", |play, fault| {
        play.slept += 600.0;
        play.allowed = 0.0..=HIGH * 1.01;
        play.run(180.0, false).assert_lost(fault, &["did not move", "say the same"]);
        play.allowed = TRUE;
        play.assert_returns(fault);
    });
}

/// A card that sleeps is lost with the reason, is not woken by a reading, and comes back.
#[test]
fn a_card_that_sleeps_is_said_to_and_is_not_woken() {
    each(Variant::is_card, "runtime suspended", |play, fault| {
        let device = play.main().split("/hwmon/").next().expect("a folder").to_owned();
        play.tree.write(&format!("{device}/power/runtime_status"), "suspended");
        opened();
        play.run(60.0, true).assert_lost(fault, &["the GPU sleeps (runtime suspended)"]);
        let opened = opened();
        let is_power = |name: &String| name.starts_with("power1") || name.starts_with("energy");
        assert!(!opened.iter().any(is_power), "a reading wakes it");
        play.tree.write(&format!("{device}/power/runtime_status"), "active");
        play.assert_returns(fault);
    });
}

#[test]
fn what_a_meter_covers_is_in_its_provenance() {
    let told = |name: &str| {
        let variant = VARIANTS.iter().find(|variant| variant.name == name).expect("a meter");
        Play::new(*variant, 0.0).meter.info().description
    };
    for (name, words) in [
        ("rapl, two packages", &["package-0 + package-1", "all programs"][..]),
        ("amdgpu, input beside an average that never answers", &["0000:c1:00.0"]),
        ("xe, card and package", &["whole card 8086:0000"]),
        ("battery, power", &["whole machine with display", "BAT0 discharges"]),
        ("jetson, VDD_IN", &["whole module", "VDD_IN"]),
        ("jetson, the rails of an AGX module", &["VDD_GPU_SOC + VDD_CPU_CV + VIN_SYS_5V0"]),
    ] {
        let told = told(name);
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
        for number in ["card0", "card1", "hwmon", "power1_", "energy1_", "energy2_"] {
            assert!(!told.contains(number), "{told}");
        }
    }
}

#[test]
fn a_card_whose_number_went_to_another_card_is_found_by_its_address() {
    let variant = Variant {
        name: "amdgpu",
        kind: &super::gpu::AMD,
        parameter: Some("card0"),
        files: &[
            ("sys/class/drm/card0/device/vendor", "0x1002"),
            ("sys/class/drm/card0/device/uevent", "PCI_SLOT_NAME=0000:03:00.0"),
            ("sys/class/drm/card0/device/hwmon/hwmon2/name", "amdgpu"),
            ("sys/class/drm/card1/device/vendor", "0x1002"),
            ("sys/class/drm/card1/device/uevent", "PCI_SLOT_NAME=0000:04:00.0"),
            ("sys/class/drm/card1/device/hwmon/hwmon2/name", "amdgpu"),
            ("sys/class/drm/card1/device/hwmon/hwmon2/power1_average", "150000000"),
        ],
        live: &[("sys/class/drm/card0/device/hwmon/hwmon2/power1_average", Reads::Power(1e6))],
        renames: &[],
    };
    let mut play = Play::started(variant, 0.0);
    play.tree.rename("sys/class/drm/card1", "sys/class/drm/other");
    play.rename("sys/class/drm/card0", "sys/class/drm/card1");
    play.tree.rename("sys/class/drm/other", "sys/class/drm/card0");
    play.run(0.1, true).assert_lost("swapped", &["no longer card 0000:03:00.0"]);
    play.assert_returns("swapped");
}

#[test]
fn a_module_without_an_input_rail_is_refused_with_its_rails() {
    let tree = Tree::of(&[
        ("sys/class/hwmon/hwmon1/name", "ina3221"),
        ("sys/class/hwmon/hwmon1/in1_label", "VDD_GPU_SOC"),
        ("sys/class/hwmon/hwmon1/in2_label", "VDD_SYS_CPU"),
    ]);
    let refusal = |rail| (jetson::KIND.open)(&tree.root(), rail).err().expect("no input rail");
    let message = refusal(Wanted::Usual).to_string();
    assert!(message.contains("VDD_GPU_SOC, VDD_SYS_CPU"), "{message}");
    assert!(refusal(Wanted::Named("VDD")).to_string().contains("no rail \"VDD\""));
}

#[cfg(unix)]
#[test]
fn a_file_that_hangs_is_lost_in_seconds_and_comes_back() {
    let jetson = VARIANTS.iter().find(|one| one.name == "jetson, VDD_IN").expect("a variant");
    let play = Play::new(*jetson, 0.0);
    let (root, path) = (play.tree.root(), play.tree.path(&play.main()));
    let open = move || (jetson::KIND.open)(&root, Wanted::Usual);
    let sampler = PowerSampler::start(open, SamplerSettings::default(), false).expect("a thread");
    let start = Instant::now();
    let wait = |what: &str, is_so: &dyn Fn(&MeterState) -> bool| {
        while !is_so(&sampler.snapshot().state) {
            assert!(start.elapsed() < Duration::from_secs(30), "{what}: {:?}", sampler.snapshot());
            std::thread::sleep(Duration::from_millis(10));
        }
    };
    wait("a reading", &|state| *state == MeterState::Running);
    // A pipe that nobody writes to never opens.
    std::fs::remove_file(&path).expect("a file");
    let made = std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo");
    assert!(made.success());
    let hangs = |state: &MeterState| matches!(state, MeterState::Lost { reason } if reason.contains("not answered for"));
    wait("it hangs", &hangs);
    // A writer that says nothing ends the reader.
    drop(std::fs::OpenOptions::new().write(true).open(&path).expect("a pipe"));
    std::fs::remove_file(&path).expect("a pipe");
    play.write();
    wait("it answers again", &|state| *state == MeterState::Running);
}

//! Batteries of which some rest, and ports that feed others.

use super::super::battery;
use super::super::testing::Tree;
use super::each;
use super::play::Play;
use super::variants::{VARIANTS, Variant};
use crate::power::battery::{Cells, Feed, feed_of};
use crate::power::meter::Wanted;

const BAT0: &str = "sys/class/power_supply/BAT0";
const BAT1: &str = "sys/class/power_supply/BAT1";

fn with(tree: &Tree, folder: &str, files: &[(&str, &str)]) {
    let _ = std::fs::remove_dir_all(tree.path(folder));
    files.iter().for_each(|(file, text)| tree.write(&format!("{folder}/{file}"), text));
}

/// The power of the machine's batteries, or why it is not known.
fn power(tree: &Tree) -> Result<f64, String> {
    let meter = (battery::KIND.open)(&tree.root(), Wanted::Usual);
    let mut meter = meter.map_err(|error| error.to_string())?;
    match meter.read().map_err(|error| error.to_string())? {
        crate::power::Reading::Power { power, .. } => Ok(power.0),
        other => panic!("{other:?}"),
    }
}

/// A machine whose first battery gives 11 W and has 20 Wh.
fn machine() -> Tree {
    Tree::of(&[
        ("sys/class/power_supply/AC/type", "Mains"),
        ("sys/class/power_supply/AC/online", "0"),
        ("sys/class/power_supply/BAT0/type", "Battery"),
        ("sys/class/power_supply/BAT0/status", "Discharging"),
        ("sys/class/power_supply/BAT0/power_now", "-11000000"),
        ("sys/class/power_supply/BAT0/energy_now", "20000000"),
    ])
}

fn watt_hours(tree: &Tree) -> Option<f64> {
    let mut files = battery::Files { root: tree.root(), wanted: None };
    let Feed::Batteries(energy, power) = feed_of(&files.read().ok()?) else { return None };
    assert_eq!(Ok(power.0), super::batteries::power(tree), "one reading for both");
    Some((energy.0 / 3600.0 * 1e6).round() / 1e6)
}

#[test]
fn a_second_battery_that_rests_leaves_the_first_ones_power() {
    let tree = machine();
    for (files, left) in [
        (&[("status", "Unknown"), ("power_now", "0"), ("energy_now", "15000000")][..], 35.0),
        (&[("status", "Unknown"), ("charge_now", "1500000"), ("voltage_now", "10000000")], 35.0),
        (&[("status", "Unknown"), ("current_now", "0"), ("voltage_now", "11400000")], 20.0),
        (&[("status", "Unknown"), ("power_now", "0"), ("energy_now", "0")], 20.0),
        (&[("status", "Not charging"), ("energy_now", "15000000")], 35.0),
        (&[("status", "Full"), ("power_now", "3000000"), ("energy_now", "15000000")], 35.0),
        (&[("status", "Full"), ("charge_now", "0")], 20.0),
        (&[("status", "Discharging"), ("power_now", "0"), ("energy_now", "1000000")], 21.0),
        // Empty, with what it last gave.
        (&[("status", "Discharging"), ("power_now", "9000000"), ("energy_now", "0")], 20.0),
        (&[("present", "0")], 20.0),
        (&[("present", "0"), ("status", "Discharging"), ("power_now", "9000000")], 20.0),
        (&[("present", "0"), ("status", "Charging")], 20.0),
        (&[], 20.0),
    ] {
        let files = [&[("type", "Battery")], files].concat();
        with(&tree, BAT1, &files);
        assert_eq!((power(&tree), watt_hours(&tree)), (Ok(11.0), Some(left)), "{files:?}");
        // It comes to a running meter of each kind of battery, and goes.
        each(Variant::is_battery, &format!("a second one that rests, {files:?}"), |play, fault| {
            with(&play.tree, "sys/class/power_supply/BAT9", &files);
            play.run(30.0, true);
            assert!(play.is_running() && play.warnings.is_empty(), "{fault}");
            std::fs::remove_dir_all(play.tree.path("sys/class/power_supply/BAT9")).expect("it");
            play.assert_returns(fault);
        });
    }
    with(&tree, BAT1, &[("type", "Battery"), ("status", "Discharging"), ("power_now", "4000000")]);
    assert_eq!((power(&tree), watt_hours(&tree)), (Ok(15.0), None), "energy unknown");
}

#[test]
fn a_battery_that_may_take_power_leaves_it_unknown() {
    let tree = machine();
    for (status, watts) in [("Charging", "5000000"), ("Charging", "0"), ("Unknown", "5000000")] {
        let files = [("type", "Battery"), ("status", status), ("power_now", watts)];
        with(&tree, BAT1, &files);
        let reason = power(&tree).expect_err(status);
        assert!(reason.contains(&format!("BAT1 is {status}")), "{reason}");
        assert_eq!(watt_hours(&tree), None);
    }
    // Nor is one alone that says Unknown.
    for files in [&[("status", "Unknown"), ("power_now", "0")][..], &[("status", "Unknown")]] {
        let tree = machine();
        with(&tree, BAT0, &[&[("type", "Battery")], files].concat());
        assert!(power(&tree).expect_err("unknown").contains("BAT0 is Unknown"));
    }
    for text in ["-5", "unknown", ""] {
        with(&tree, BAT1, &[("type", "Battery"), ("status", "Full"), ("energy_now", text)]);
        assert_eq!(watt_hours(&tree), None, "{text}");
    }
    with(&tree, BAT0, &[("type", "Battery"), ("present", "0")]);
    with(&tree, BAT1, &[("type", "Battery"), ("present", "0")]);
    assert!(power(&tree).expect_err("empty bays").contains("no battery of the machine"));
}

#[test]
fn a_port_that_feeds_a_phone_is_no_charger() {
    let port = "sys/class/power_supply/ucsi-source-psy-USBC000:002";
    let online = [("type", "USB"), ("online", "1"), ("usb_type", "[C] PD PD_PPS")];
    let tree = machine();
    with(&tree, port, &online);
    assert!(power(&tree).expect_err("a charger").contains("charger feeds"));
    for sign in [
        ("status", "Discharging"),
        ("current_now", "-900000"),
        ("scope", "Device"),
        ("power_role", "[source] sink"),
        ("online", "0"),
    ] {
        with(&tree, port, &[&online[..], &[sign]].concat());
        assert_eq!(power(&tree), Ok(11.0), "{sign:?}");
    }
    with(&tree, port, &[&online[..], &[("power_role", "source [sink]")]].concat());
    assert!(power(&tree).is_err());
    // Without a word of its own, the port's contract tells.
    with(&tree, port, &online);
    with(&tree, "sys/class/typec/port0", &[("power_role", "source [sink]")]);
    with(&tree, "sys/class/typec/port1", &[("power_role", "[source] sink")]);
    assert_eq!(power(&tree), Ok(11.0));
    with(&tree, "sys/class/typec/port1", &[("power_role", "source [sink]")]);
    assert!(power(&tree).is_err());
    // A weak charger beside the port, and batteries of a mouse.
    with(&tree, port, &[&online[..], &[("status", "Discharging")]].concat());
    let mouse = "sys/class/power_supply/hidpp_battery_0";
    with(&tree, mouse, &[("type", "Battery"), ("scope", "Device"), ("status", "Charging")]);
    assert_eq!(power(&tree), Ok(11.0));
    tree.write("sys/class/power_supply/AC/online", "1");
    assert!(power(&tree).expect_err("a charger").contains("charger feeds"));
}

#[test]
fn a_charger_or_another_status_stops_the_meter_until_it_goes() {
    let battery = VARIANTS.iter().find(|variant| variant.name == "battery, power");
    let mut play = Play::started(*battery.expect("a battery"), 0.0);
    play.tree.write("sys/class/power_supply/AC/online", "1");
    play.run(60.0, true).assert_lost("charger", &["charger feeds"]);
    play.tree.write("sys/class/power_supply/AC/online", "0");
    play.assert_returns("charger");
    for status in ["Charging", "Full", "Not charging", "Unknown"] {
        each(Variant::is_battery, status, |play, status| {
            let file = play.main().rsplit_once('/').expect("a folder").0.to_owned() + "/status";
            play.tree.write(&file, status);
            play.run(60.0, true).assert_lost(status, &[status]);
            play.tree.write(&file, "Discharging");
            play.assert_returns(status);
        });
    }
}

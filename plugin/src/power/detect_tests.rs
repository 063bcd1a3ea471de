//! Tests of the choice of a meter.

use super::*;
use crate::power::sysfs::testing::Tree;
use crate::power::{AdapterKind, Provenance};

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let message = open("wattmeter").err().expect("there is no such meter").to_string();
    for part in ["\"wattmeter\"", "nvml", "cpu-time[=WATTS_PER_CORE]"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(matches!(open(""), Err(OpenMeterError::UnknownName { .. })));
}

#[cfg(unix)]
#[test]
fn a_parameter_reaches_its_meter() {
    let info = open("cpu-time=5.0").expect("every unix has the clock").info();
    assert!(info.description.contains("× 5 W per busy core"), "{}", info.description);
    for bad in ["cpu-time=", "cpu-time=much", "cpu-time=-1", "cpu-time=nan", "cpu-time=inf"] {
        assert!(matches!(open(bad), Err(OpenMeterError::Parameter { .. })), "{bad}");
    }
}

#[cfg(unix)]
#[test]
fn software_rendering_is_metered_on_the_cpu_whatever_boards_are_present() {
    let adapter = Adapter {
        kind: AdapterKind::Software,
        name: "llvmpipe (LLVM 19, 256 bits)".to_owned(),
        ..Adapter::default()
    };
    let info = detect(&adapter).expect("every unix has the clock").info();
    assert_eq!((info.name.as_str(), info.provenance), ("cpu-time", Provenance::Modelled));
}

#[test]
fn a_gpu_of_another_vendor_gets_reasons_and_no_meter() {
    let adapter = Adapter {
        kind: AdapterKind::Hardware,
        name: "Some Other GPU".to_owned(),
        ..Adapter::default()
    };
    let message = detect(&adapter).err().expect("no meter covers it").to_string();
    assert!(message.contains("nvml:") && message.contains("cpu-time:"), "{message}");
}

#[test]
fn every_meter_is_listed_and_names_itself() {
    let known = meters();
    let names: Vec<_> = known.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["nvml", "amdgpu", "intel-gpu", "rapl", "jetson", "battery", "cpu-time"]);
    let empty = Tree::new();
    for (name, usage) in known {
        assert!(usage.starts_with(name));
        match open_in(&empty.root(), name) {
            Ok(meter) => assert_eq!(meter.info().name, name),
            Err(error) => assert!(error.to_string().starts_with(name), "{error}"),
        }
    }
    for name in ["amdgpu", "intel-gpu", "rapl", "jetson", "battery"] {
        assert!(open_in(&empty.root(), name).is_err(), "an empty machine has no files");
    }
}

/// A laptop with an AMD chip beside a card of another vendor, RAPL and a battery.
fn laptop() -> Tree {
    Tree::of(&[
        ("sys/class/drm/card0/device/vendor", "0x10de"),
        ("sys/class/drm/card1/device/vendor", "0x1002"),
        ("sys/class/drm/card1/device/device", "0x163f"),
        ("sys/class/drm/card1/device/uevent", "PCI_SLOT_NAME=0000:04:00.0"),
        ("sys/class/drm/card1/device/hwmon/hwmon2/name", "amdgpu"),
        ("sys/class/drm/card1/device/hwmon/hwmon2/power1_average", "9000000"),
        ("sys/class/powercap/intel-rapl:0/name", "package-0"),
        ("sys/class/powercap/intel-rapl:0/energy_uj", "7"),
        ("sys/class/power_supply/BAT0/type", "Battery"),
        ("sys/class/power_supply/BAT0/status", "Discharging"),
        ("sys/class/power_supply/BAT0/power_now", "14000000"),
    ])
}

fn adapter(vendor_id: u32, device_id: u32, pci_bus_id: &str, is_integrated: bool) -> Adapter {
    Adapter {
        kind: AdapterKind::Hardware,
        vendor_id,
        device_id,
        pci_bus_id: pci_bus_id.to_owned(),
        is_integrated,
        ..Adapter::default()
    }
}

/// The name of the detected meter, and why the others do not suit.
fn detected(tree: &Tree, adapter: &Adapter) -> Result<String, String> {
    detect_in(&tree.root(), adapter).map(|m| m.info().name).map_err(|error| error.to_string())
}

#[test]
fn the_gpus_own_meter_comes_before_those_that_contain_more() {
    let tree = laptop();
    for found in [(0x163f, "0000:04:00.0"), (0x163f, ""), (0, ""), (1, "00000000:04:00.0")] {
        let amd = adapter(0x1002, found.0, found.1, true);
        assert_eq!(detected(&tree, &amd).as_deref(), Ok("amdgpu"), "{found:?}");
    }
    // Another board or model than the one with a meter; the battery contains it.
    for other in [(0x163f, "0000:05:00.0"), (0x9999, "")] {
        let amd = adapter(0x1002, other.0, other.1, false);
        assert_eq!(detected(&tree, &amd).as_deref(), Ok("battery"), "{other:?}");
    }
    let intel = adapter(0x8086, 0, "", true);
    tree.fail("sys/class/powercap/intel-rapl:0/energy_uj", Some(13));
    assert_eq!(detected(&tree, &intel).as_deref(), Ok("battery"));
    tree.write("sys/class/power_supply/BAT0/status", "Charging");
    let reasons = detected(&tree, &intel).expect_err("no meter is left");
    for part in ["nvml: ", "another vendor's", "sudo chmod", "is Charging", "which CPU time"] {
        assert!(reasons.contains(part), "{part}: {reasons}");
    }
}

#[test]
fn a_counter_that_never_moves_is_no_meter() {
    let message = open_in(&laptop().root(), "rapl").err().expect("it is stuck").to_string();
    assert!(message.contains("did not move"), "{message}");
}

#[test]
fn software_rendering_keeps_its_model_on_a_laptop() {
    let software = Adapter { kind: AdapterKind::Software, ..Adapter::default() };
    let found = detected(&laptop(), &software);
    assert_eq!(found.as_deref(), if cfg!(unix) { Ok("cpu-time") } else { found.as_deref() });
}

#[test]
fn an_unknown_adapter_gets_no_part_of_a_machine_with_several_cards() {
    let tree = laptop();
    assert_eq!(detected(&tree, &Adapter::default()).as_deref(), Ok("battery"));
    std::fs::remove_dir_all(tree.path("sys/class/drm/card0")).expect("a card");
    assert_eq!(detected(&tree, &Adapter::default()).as_deref(), Ok("amdgpu"));
}

#[test]
fn meters_of_files_are_opened_by_name_and_parameter() {
    let tree = laptop();
    for name in ["amdgpu", "amdgpu=card1", "amdgpu = 0000:04:00.0", "battery=BAT0"] {
        open_in(&tree.root(), name).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    for (name, words) in [
        ("amdgpu=card0", "card1 (0000:04:00.0)"),
        ("amdgpu=", "card0, or a PCI address"),
        ("intel-gpu", "no card of this vendor"),
        ("rapl=dram", "package or psys"),
        ("battery=BAT7", "no battery \"BAT7\""),
        ("jetson", "is this a Jetson?"),
    ] {
        let message = open_in(&tree.root(), name).err().expect("an error").to_string();
        assert!(message.contains(words), "{name}: {message}");
    }
    tree.write("sys/class/drm/card0/device/vendor", "0x1002");
    let message = open_in(&tree.root(), "amdgpu").err().expect("two cards").to_string();
    assert!(message.contains("several cards"), "{message}");
}

/// Two cards, of which the NVIDIA one sleeps.
fn laptop_with_a_sleeping_card() -> Tree {
    Tree::of(&[
        ("sys/class/drm/card0/device/vendor", "0x8086"),
        ("sys/class/drm/card0/device/uevent", "PCI_SLOT_NAME=0000:00:02.0"),
        ("sys/class/drm/card1/device/vendor", "0x10de"),
        ("sys/class/drm/card1/device/uevent", "PCI_SLOT_NAME=0000:01:00.0"),
        ("sys/class/drm/card1/device/power/runtime_status", "suspended"),
    ])
}

#[cfg(feature = "nvml")]
#[test]
fn a_card_that_sleeps_or_may_not_render_is_not_woken_by_its_library() {
    let tree = laptop_with_a_sleeping_card();
    let refusal = |adapter: &Adapter| {
        let opened = (nvml::KIND.open)(&tree.root(), Wanted::For(adapter));
        opened.err().expect("no meter").to_string()
    };
    let renders = adapter(0x10de, 0, "00000000:01:00.0", false);
    assert!(refusal(&Adapter::default()).contains("several cards"));
    assert!(refusal(&renders).contains("the GPU sleeps (runtime suspended)"));
    let named = (nvml::KIND.open)(&tree.root(), Wanted::Usual).err().expect("no meter");
    assert!(named.to_string().contains("the GPU sleeps"), "{named}");
    tree.write("sys/class/drm/card1/device/power/runtime_status", "active");
    assert!(refusal(&Adapter::default()).contains("several cards"));
    assert!(!refusal(&renders).contains("sleeps"), "the library is asked");
    std::fs::remove_dir_all(tree.path("sys/class/drm/card1")).expect("a card");
    assert!(refusal(&Adapter::default()).contains("another vendor's"));
}

#[test]
fn a_card_that_sleeps_is_no_matter_of_permission() {
    let tree = laptop();
    tree.fail("sys/class/drm/card1/device/hwmon/hwmon2/power1_average", Some(1));
    let message = open_in(&tree.root(), "amdgpu").err().expect("it sleeps").to_string();
    assert!(message.contains("the GPU sleeps (runtime suspended)"), "{message}");
}

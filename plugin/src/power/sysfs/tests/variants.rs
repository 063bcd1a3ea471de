//! Kinds of meters with the files that they read.

use super::super::{battery, gpu, jetson, rapl};
use crate::power::meter::MeterKind;
use crate::power::root::SysRoot;
use crate::power::{MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::Joules;

/// A kind of meter with its files.
#[derive(Clone, Copy)]
pub(super) struct Variant {
    pub name: &'static str,
    pub kind: &'static MeterKind,
    pub parameter: Option<&'static str>,
    /// Files that stay, with traps among them.
    pub files: &'static [(&'static str, &'static str)],
    /// Files of the power, with what they read: the first one fails.
    pub live: &'static [(&'static str, Reads)],
    /// Folders that a restarted driver numbers anew.
    pub renames: &'static [(&'static str, &'static str)],
}

impl Variant {
    pub(super) fn is_counter(&self) -> bool {
        matches!(self.live[0].1, Reads::Energy(..))
    }

    pub(super) fn is_card(&self) -> bool {
        self.live[0].0.contains("/drm/")
    }

    pub(super) fn is_battery(&self) -> bool {
        self.kind.name == "battery"
    }
}

/// What a file reads.
#[derive(Clone, Copy)]
pub(super) enum Reads {
    /// Microjoules: a share of the energy, modulo a range.
    Energy(f64, i64),
    /// Units per watt.
    Power(f64),
}

/// A meter that calls a driver, played by a file.
const CALLS: MeterKind = MeterKind {
    name: "nvml",
    usage: "nvml",
    expected: "",
    open: |root, _| Ok(Box::new(Calls(root.clone()))),
};

struct Calls(SysRoot);

impl PowerMeter for Calls {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: "nvml".to_owned(),
            provenance: Provenance::Measured,
            description: "calls".to_owned(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        let text = self.0.word(&self.0.path("counter"));
        let number = text.and_then(|text| text.parse::<f64>().ok());
        number.map(|microjoules| Joules(microjoules * 1e-6)).ok_or_else(|| {
            MeterError::unreadable("nvml", "permission denied, no number, or the board is gone")
        })
    }

    fn window_seconds(&self) -> f64 {
        1.0
    }
}

/// Where most packages' counters start again, µJ.
const RANGE: i64 = 262_143_328_850;

/// The meters of the matrix.
pub(super) const VARIANTS: &[Variant] = &[
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
        renames: &[("sys/class/powercap/intel-rapl:0", "sys/class/powercap/intel-rapl:4")],
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
        renames: &[("sys/class/powercap/intel-rapl:1", "sys/class/powercap/intel-rapl:4")],
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
        renames: &[("sys/class/powercap/intel-rapl:1", "sys/class/powercap/intel-rapl:4")],
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
        renames: &[(
            "sys/class/drm/card1/device/hwmon/hwmon4",
            "sys/class/drm/card1/device/hwmon/hwmon5",
        )],
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
        renames: &[("sys/class/drm/card0", "sys/class/drm/card7")],
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
        renames: &[("sys/class/drm/card0", "sys/class/drm/card1")],
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
        renames: &[(
            "sys/class/drm/card0/device/hwmon/hwmon3",
            "sys/class/drm/card0/device/hwmon/hwmon1",
        )],
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
        renames: &[("sys/class/power_supply/BAT0", "sys/class/power_supply/BATC")],
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
        renames: &[],
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
        renames: &[("sys/class/power_supply/BAT0", "sys/class/power_supply/BATC")],
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
        renames: &[("sys/class/power_supply/BAT1", "sys/class/power_supply/BATC")],
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
        renames: &[("sys/class/hwmon/hwmon1", "sys/class/hwmon/hwmon3")],
    },
    Variant {
        name: "jetson, POM_5V_IN of the older driver",
        kind: &jetson::KIND,
        parameter: None,
        files: &[
            ("sys/bus/iio/devices/iio:device0/name", "ina3221x"),
            ("sys/bus/iio/devices/iio:device0/rail_name_0", "POM_5V_IN"),
            ("sys/bus/iio/devices/iio:device0/rail_name_1", "POM_5V_GPU"),
            ("sys/bus/iio/devices/iio:device0/in_power1_input", "900"),
        ],
        live: &[("sys/bus/iio/devices/iio:device0/in_power0_input", Reads::Power(1e3))],
        renames: &[("sys/bus/iio/devices/iio:device0", "sys/bus/iio/devices/iio:device2")],
    },
    Variant {
        name: "jetson, VIN of an ina238",
        kind: &jetson::KIND,
        parameter: None,
        files: &[
            ("sys/class/hwmon/hwmon0/name", "ina238"),
            ("sys/class/hwmon/hwmon1/name", "ina3221"),
            ("sys/class/hwmon/hwmon1/in1_label", "VDD_GPU"),
            ("sys/class/hwmon/hwmon1/in1_input", "19000"),
            ("sys/class/hwmon/hwmon1/curr1_input", "300"),
        ],
        live: &[("sys/class/hwmon/hwmon0/power1_input", Reads::Power(1e6))],
        renames: &[("sys/class/hwmon/hwmon0", "sys/class/hwmon/hwmon3")],
    },
    Variant {
        name: "jetson, the rails of an AGX module",
        kind: &jetson::KIND,
        parameter: None,
        files: &[
            ("sys/class/hwmon/hwmon1/name", "ina3221"),
            ("sys/class/hwmon/hwmon1/in1_label", "VDD_GPU_SOC"),
            ("sys/class/hwmon/hwmon1/in1_input", "20000"),
            ("sys/class/hwmon/hwmon1/in2_label", "VDD_CPU_CV"),
            ("sys/class/hwmon/hwmon1/in2_input", "20000"),
            ("sys/class/hwmon/hwmon1/in3_label", "VIN_SYS_5V0"),
            ("sys/class/hwmon/hwmon1/in3_input", "5000"),
            ("sys/class/hwmon/hwmon2/name", "ina3221"),
            ("sys/class/hwmon/hwmon2/in1_label", "NC"),
            ("sys/class/hwmon/hwmon2/in2_label", "VDDQ_VDD2_1V8AO"),
            ("sys/class/hwmon/hwmon2/in2_input", "5000"),
            ("sys/class/hwmon/hwmon2/curr2_input", "400"),
        ],
        live: &[
            ("sys/class/hwmon/hwmon1/curr1_input", Reads::Power(0.5e3 / 20.0)),
            ("sys/class/hwmon/hwmon1/curr2_input", Reads::Power(0.3e3 / 20.0)),
            ("sys/class/hwmon/hwmon1/curr3_input", Reads::Power(0.2e3 / 5.0)),
        ],
        renames: &[("sys/class/hwmon/hwmon1", "sys/class/hwmon/hwmon3")],
    },
    Variant {
        name: "two batteries, one Unknown",
        kind: &battery::KIND,
        parameter: None,
        files: &[
            ("sys/class/power_supply/AC/type", "Mains"),
            ("sys/class/power_supply/AC/online", "0"),
            ("sys/class/power_supply/BAT0/type", "Battery"),
            ("sys/class/power_supply/BAT0/present", "1"),
            ("sys/class/power_supply/BAT0/status", "Unknown"),
            ("sys/class/power_supply/BAT0/power_now", "0"),
            ("sys/class/power_supply/BAT1/type", "Battery"),
            ("sys/class/power_supply/BAT1/present", "1"),
            ("sys/class/power_supply/BAT1/status", "Discharging"),
        ],
        live: &[("sys/class/power_supply/BAT1/power_now", Reads::Power(1e6))],
        renames: &[("sys/class/power_supply/BAT1", "sys/class/power_supply/BATC")],
    },
    Variant {
        name: "a counter by calls, as NVML's",
        kind: &CALLS,
        parameter: None,
        files: &[],
        live: &[("counter", Reads::Energy(1.0, i64::MAX))],
        renames: &[],
    },
];

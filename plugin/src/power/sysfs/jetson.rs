//! Jetson modules by the monitors of their rails.
//!
//! | monitor | where | what it shows |
//! |---|---|---|
//! | INA3221, Xavier NX, Orin and later | `hwmon`, `inN_label` | millivolts, milliamperes |
//! | INA3221, Nano, TX1, TX2, Xavier to L4T 32 | `iio`, `rail_name_N` | milliwatts |
//! | INA238, Thor's carrier | `hwmon` | microwatts |
//!
//! The input rail feeds all others, so it is counted alone. AGX modules have none; their rails are
//! added up. For other modules it is unknown which rails contain each other.

use std::path::{Path, PathBuf};

use super::{FileKind, Found, Quantity, open as open_files};
use crate::power::MeterError;
use crate::power::meter::{MeterKind, Wanted};
use crate::power::root::SysRoot;

const NAME: &str = "jetson";
/// Names of the input rail: Nano; Xavier NX, Orin NX and Nano, TX2; Xavier NX before; Thor; TX1;
/// older boards.
const INPUTS: [&str; 6] = ["POM_5V_IN", "VDD_IN", "5V_IN", "VIN", "VDD_MUX", "VDD_SYS"];
/// Rails of modules without an input rail, which together are the module: AGX Xavier, AGX Orin, Thor.
/// What they feed has rails, too, which are not named here.
const SUMS: [&[&str]; 3] = [
    &["GPU", "CPU", "SOC", "CV", "VDDRQ", "SYS5V"],
    &["VDD_GPU_SOC", "VDD_CPU_CV", "VIN_SYS_5V0"],
    &["VDD_GPU", "VDD_CPU_SOC_MSS", "VIN_SYS_5V0"],
];

pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: "jetson[=RAIL]",
    expected: "the label of a rail, such as VDD_IN",
    open: |root, wanted| open_files(&FILES, root, wanted),
};

static FILES: FileKind = FileKind {
    name: NAME,
    remedy: "give this user access to the monitor's folder, in a container too",
    // Ten readings.
    window_seconds: 1.0,
    find,
};

/// A rail's name and power.
type Rail = (String, Quantity);

/// All rails of all monitors.
fn rails(root: &SysRoot) -> Vec<Rail> {
    let mut rails = Vec::new();
    for (folder, name) in root.named(&root.path("sys/class/hwmon"), "hwmon") {
        if name == "ina3221" {
            rails.extend((1..=3).filter_map(|channel| {
                let label = root.word(&folder.join(format!("in{channel}_label")))?;
                let file = |name: String| root.number(folder.join(name));
                let volts = file(format!("in{channel}_input"));
                let files = vec![volts, file(format!("curr{channel}_input"))];
                Some((label, Quantity::Power { files, unit: 1e-6 }))
            }));
        } else if name == "ina238" {
            let label = root.word(&folder.join("label"));
            let files = vec![root.number(folder.join("power1_input"))];
            let rail = Quantity::Power { files, unit: 1e-6 };
            rails.push((label.unwrap_or_else(|| "VIN".to_owned()), rail));
        }
    }
    for folder in iio_devices(root) {
        rails.extend((0..=2).filter_map(|channel| {
            let name = root.word(&folder.join(format!("rail_name_{channel}")))?;
            let files = vec![root.number(folder.join(format!("in_power{channel}_input")))];
            Some((name, Quantity::Power { files, unit: 1e-3 }))
        }));
    }
    // Channels that are not connected.
    rails.retain(|(name, _)| name != "NC");
    rails
}

/// Folders of the monitors that NVIDIA's older driver serves. Not every kernel lists them on the bus.
fn iio_devices(root: &SysRoot) -> Vec<PathBuf> {
    let of = |folder: &Path| root.numbered(folder, "iio:device");
    let listed = of(&root.path("sys/bus/iio/devices"));
    let is_ours =
        |folder: &PathBuf| root.word(&folder.join("name")).is_none_or(|n| n.starts_with("ina3221"));
    let listed: Vec<PathBuf> = listed.into_iter().filter(is_ours).collect();
    if !listed.is_empty() {
        return listed;
    }
    let drivers = ["sys/bus/i2c/drivers/ina3221x", "sys/bus/i2c/drivers/ina3221"];
    let chips = drivers.iter().flat_map(|driver| root.list(&root.path(driver), |_| true));
    // Some kernels put a folder `iio` or `iio_device` between.
    let folders = chips.flat_map(|chip| {
        let between = root.list(&chip, |name| name == "iio" || name == "iio_device");
        std::iter::once(chip).chain(between)
    });
    folders.flat_map(|folder| of(&folder)).collect()
}

fn find(root: &SysRoot, wanted: Wanted) -> Result<Found, MeterError> {
    if let Wanted::For(adapter) = wanted {
        adapter.is_part_of(NAME, "the module")?;
    }
    let rails = rails(root);
    if rails.is_empty() {
        let folders = [root.path("sys/class/hwmon"), root.path("sys/bus/iio/devices")];
        let [hwmon, iio] = folders.map(|folder| folder.display().to_string());
        let reason = format!("no ina3221 or ina238 monitor in {hwmon} or {iio}: is this a Jetson?");
        return Err(MeterError::unavailable(NAME, reason));
    }
    let rail = |name: &str| rails.iter().find(|(other, _)| other == name).cloned();
    let all = |names: &[&str]| names.iter().map(|name| rail(name)).collect::<Option<Vec<Rail>>>();
    let (found, missing) = match wanted {
        Wanted::Named(names) => {
            let names: Vec<&str> = names.split('+').map(str::trim).collect();
            (all(&names), format!("there is no rail \"{}\"", names.join("+")))
        }
        _ => {
            let input = INPUTS.iter().find_map(|name| all(&[name]));
            let found = input.or_else(|| SUMS.iter().find_map(|names| all(names)));
            (found, "no rail of the module's input".to_owned())
        }
    };
    let Some(found) = found else {
        let names: Vec<_> = rails.iter().map(|(name, _)| name.as_str()).collect();
        let reason = format!("{missing}; name one of {} after =", names.join(", "));
        return Err(MeterError::unavailable(NAME, reason));
    };
    let (names, parts): (Vec<String>, _) = found.into_iter().unzip();
    let is_input = INPUTS.contains(&names[0].as_str());
    let whole = if is_input || names.len() > 1 { "whole module, " } else { "" };
    let rails = if names.len() > 1 { "rails" } else { "rail" };
    Ok(Found {
        what: format!("{whole}{rails} {}, all programs, power monitors", names.join(" + ")),
        identity: names.join("+"),
        parts,
        card: None,
    })
}

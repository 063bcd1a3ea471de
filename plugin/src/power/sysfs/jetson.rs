//! Jetson modules by the ina3221 monitors of their rails: volts times amperes of the input rail.
//!
//! The input feeds all other rails, so that nothing is added to it. Modules without a rail of their
//! own for the input are refused: which of their rails contain each other differs by module.

use std::path::PathBuf;
use std::time::Duration;

use super::integrate::Gauge;
use super::root::NumberFile;
use super::{Source, SourceKind, SysRoot};
use crate::power::adapter::CPU_TIME_IS_BETTER;
use crate::power::{Adapter, AdapterKind, MeterError, MeterInfo, Provenance};
use crate::units::{Joules, Watts};

const NAME: &str = "jetson";
const REMEDY: &str = "give this user access to the monitor's folder, in a container too";
/// Names of the input rail: Xavier NX, Orin NX and Nano, TX2; Nano; TX1; older boards.
const INPUTS: [&str; 4] = ["VDD_IN", "POM_5V_IN", "VDD_MUX", "VDD_SYS"];
/// A monitor has a resolution of 8 mA, and its rail noise.
const STALE_AFTER: Duration = Duration::from_secs(60);

pub(crate) const KIND: SourceKind = SourceKind {
    name: NAME,
    usage: "jetson[=RAIL]",
    expected: "the label of a rail, such as VDD_IN",
    find,
    find_for,
};

/// A rail with its monitor's files.
struct Rail {
    label: String,
    /// Millivolts and milliamperes.
    files: [NumberFile; 2],
    gauge: Gauge,
}

/// Labels and files of all rails.
fn rails(root: &SysRoot) -> Vec<(String, [NumberFile; 2])> {
    let monitors = root.list(&root.path("sys/class/hwmon"), |name| name.starts_with("hwmon"));
    let is_ours =
        |folder: &PathBuf| root.word(&folder.join("name")).is_some_and(|name| name == "ina3221");
    let channels = |folder: PathBuf| {
        (1..=3).filter_map(move |channel| {
            let label = root.word(&folder.join(format!("in{channel}_label")))?;
            let file = |name: String| root.number(folder.join(name));
            let files = [file(format!("in{channel}_input")), file(format!("curr{channel}_input"))];
            Some((label, files))
        })
    };
    monitors.into_iter().filter(is_ours).flat_map(channels).collect()
}

fn find(root: &SysRoot, wanted: Option<&str>) -> Result<Box<dyn Source>, MeterError> {
    let mut rails = rails(root);
    if rails.is_empty() {
        let folder = root.path("sys/class/hwmon");
        let reason = format!("no ina3221 monitor in {}: is this a Jetson?", folder.display());
        return Err(MeterError::unavailable(NAME, reason));
    }
    let place = |label: &str| rails.iter().position(|(other, _)| other == label);
    let found = match wanted {
        Some(label) => place(label),
        None => INPUTS.iter().find_map(|label| place(label)),
    };
    let Some(found) = found else {
        let labels: Vec<_> = rails.iter().map(|(label, _)| label.as_str()).collect();
        let missing = wanted.map_or("no rail of the module's input".to_owned(), |label| {
            format!("there is no rail \"{label}\"")
        });
        let reason = format!("{missing}; name one of {} after =", labels.join(", "));
        return Err(MeterError::unavailable(NAME, reason));
    };
    let (label, files) = rails.swap_remove(found);
    Ok(Box::new(Rail { label, files, gauge: Gauge::new(STALE_AFTER) }))
}

fn find_for(root: &SysRoot, adapter: &Adapter) -> Result<Box<dyn Source>, MeterError> {
    match adapter.kind {
        AdapterKind::Hardware if adapter.is_integrated => find(root, None),
        AdapterKind::Software => Err(MeterError::unavailable(NAME, CPU_TIME_IS_BETTER)),
        _ => Err(MeterError::unavailable(
            NAME,
            "the adapter is not known to be part of the module; request it by name",
        )),
    }
}

impl Rail {
    fn power(&self) -> Result<Watts, MeterError> {
        let read = |file: &NumberFile| {
            let value = file.reading(NAME, REMEDY)?;
            // Two faults of sign would make a power.
            Ok(if value < 0 { f64::NAN } else { value as f64 })
        };
        let [millivolts, milliamperes] = &self.files;
        Ok(Watts(read(millivolts)? * read(milliamperes)? * 1e-6))
    }
}

impl Source for Rail {
    fn info(&self) -> MeterInfo {
        let whole = if INPUTS.contains(&&*self.label) { "whole module, " } else { "" };
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: format!("{whole}rail {}, all programs, ina3221 monitor", self.label),
        }
    }

    fn window_seconds(&self) -> f64 {
        1.0
    }

    fn poll(&self) -> Duration {
        Duration::from_millis(100)
    }

    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError> {
        let power = self.power();
        self.gauge.add(NAME, power, at)
    }
}

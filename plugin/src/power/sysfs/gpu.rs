//! GPUs by the hardware monitors of their drivers: AMD's power, Intel's energy.
//!
//! AMD's drivers show `power1_average`, newer ones `power1_input` instead or beside it: microwatts
//! of the card, or of the whole chip of an APU. Intel's `xe` and `i915` show `energyN_input`:
//! microjoules of the card or its package. `i915` has one more monitor for each tile, which the
//! card's contains, and none for integrated GPUs: RAPL covers those.

use std::path::Path;
use std::time::Duration;

use super::cards::{Card, choose, choose_for};
use super::integrate::{Counter, Gauge};
use super::root::{Fault, NumberFile};
use super::{Source, SourceKind, SysRoot};
use crate::power::adapter::vendor;
use crate::power::{MeterError, MeterInfo, Provenance};
use crate::units::{Joules, Watts};

const AMD_NAME: &str = "amdgpu";
const INTEL_NAME: &str = "intel-gpu";
const EXPECTED: &str = "a card, such as card0, or a PCI address, such as 0000:03:00.0";
const REMEDY: &str = "give this user access to the card's folder, in a container too";
/// An idle card may draw the same power for some time, but not one that renders.
const STALE_AFTER: Duration = Duration::from_secs(60);
/// Microjoules at which a 32-bit counter starts again.
const RANGE_32: i64 = 1 << 32;

pub(crate) const AMD: SourceKind = SourceKind {
    name: AMD_NAME,
    usage: "amdgpu[=CARD|=PCI ADDRESS]",
    expected: EXPECTED,
    find: |root, wanted| amd(root, &choose(root, AMD_NAME, vendor::AMD, wanted)?),
    find_for: |root, adapter| amd(root, &choose_for(root, AMD_NAME, vendor::AMD, adapter)?),
};

pub(crate) const INTEL: SourceKind = SourceKind {
    name: INTEL_NAME,
    usage: "intel-gpu[=CARD|=PCI ADDRESS]",
    expected: EXPECTED,
    find: |root, wanted| intel(root, &choose(root, INTEL_NAME, vendor::INTEL, wanted)?),
    find_for: |root, adapter| intel(root, &choose_for(root, INTEL_NAME, vendor::INTEL, adapter)?),
};

fn info(name: &str, what: &str, file: &Path) -> MeterInfo {
    let file = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    MeterInfo {
        name: name.to_owned(),
        provenance: Provenance::Measured,
        description: format!("{what}, all programs, {file} of its driver"),
    }
}

struct AmdGpu {
    file: NumberFile,
    gauge: Gauge,
    what: String,
}

fn amd(root: &SysRoot, card: &Card) -> Result<Box<dyn Source>, MeterError> {
    let Some((monitor, _)) = card.monitors.iter().find(|(_, name)| name == "amdgpu") else {
        let reason = format!("{} has no hardware monitor: is its driver amdgpu?", card.name);
        return Err(MeterError::unavailable(AMD_NAME, reason));
    };
    let mut first = None;
    for name in ["power1_average", "power1_input"] {
        let file = root.number(monitor.join(name));
        match file.read() {
            // One of the two may be there and never have a value.
            Ok(power) if power > 0 => {
                let label = root.word(&monitor.join("power1_label"));
                let label = label.map_or_else(String::new, |label| format!(", {label}"));
                let what = format!("whole card or APU {} ({}{label})", card.address, card.name);
                return Ok(Box::new(AmdGpu { file, gauge: Gauge::new(STALE_AFTER), what }));
            }
            Ok(power) => {
                let fault = format!("{} reads {power} µW", file.path().display());
                first = first.or(Some(MeterError::broken(AMD_NAME, fault)));
            }
            Err(Fault::Gone) => {}
            Err(fault) => first = first.or(Some(file.error(AMD_NAME, fault, REMEDY))),
        }
    }
    let absent = || {
        let reason = format!("{} has neither power1_average nor power1_input", monitor.display());
        MeterError::unavailable(AMD_NAME, reason)
    };
    Err(first.unwrap_or_else(absent))
}

impl Source for AmdGpu {
    fn info(&self) -> MeterInfo {
        info(AMD_NAME, &self.what, self.file.path())
    }

    fn window_seconds(&self) -> f64 {
        // Ten readings.
        1.0
    }

    fn poll(&self) -> Duration {
        Duration::from_millis(100)
    }

    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError> {
        let power = self.file.reading(AMD_NAME, REMEDY);
        self.gauge.add(AMD_NAME, power.map(|microwatts| Watts(microwatts as f64 * 1e-6)), at)
    }
}

struct IntelGpu {
    file: NumberFile,
    counter: Counter,
    what: String,
}

fn intel(root: &SysRoot, card: &Card) -> Result<Box<dyn Source>, MeterError> {
    let is_whole = |name: &str| name == "xe" || name == "i915";
    let monitor = card.monitors.iter().find(|(_, name)| is_whole(name));
    let channels = monitor.into_iter().flat_map(|(folder, _)| {
        (1..=4).map(move |channel| {
            let label = root.word(&folder.join(format!("energy{channel}_label")));
            (label, root.number(folder.join(format!("energy{channel}_input"))))
        })
    });
    let mut channels: Vec<_> =
        channels.filter(|(_, file)| file.read() != Err(Fault::Gone)).collect();
    // The card contains its package, and both are no sum.
    let whole = channels.iter().position(|(label, _)| label.as_deref() == Some("card"));
    if channels.is_empty() {
        let reason = format!(
            "{} has no energy counter: its driver has one for graphics cards only; rapl covers integrated GPUs",
            card.name
        );
        return Err(MeterError::unavailable(INTEL_NAME, reason));
    }
    let (label, file) = channels.swap_remove(whole.unwrap_or(0));
    let part = match label.as_deref() {
        Some("card") | None => "whole card".to_owned(),
        Some("pkg") => "package of the card, without its memory,".to_owned(),
        Some(other) => format!("part \"{other}\" of the card"),
    };
    let what = format!("{part} {} ({})", card.address, card.name);
    Ok(Box::new(IntelGpu { file, counter: Counter::new(Some(RANGE_32)), what }))
}

impl Source for IntelGpu {
    fn info(&self) -> MeterInfo {
        info(INTEL_NAME, &self.what, self.file.path())
    }

    fn window_seconds(&self) -> f64 {
        0.1
    }

    fn poll(&self) -> Duration {
        // 32 bits of microjoules last 14 s at 300 W.
        Duration::from_secs(1)
    }

    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError> {
        self.counter.add(INTEL_NAME, self.file.reading(INTEL_NAME, REMEDY), at)
    }
}

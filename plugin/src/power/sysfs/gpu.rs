//! GPUs by the hardware monitors of their drivers: AMD's power, Intel's energy.
//!
//! AMD's drivers show `power1_average`, newer ones `power1_input` instead or beside it: microwatts
//! of the card, or of the whole chip of an APU. Intel's `xe` and `i915` show `energyN_input`:
//! microjoules of the card or its package. An `i915` card's monitor contains those of its tiles.
//! Integrated GPUs have none on `i915`: RAPL covers them.

use super::cards::{Card, choose};
use super::{FileKind, Found, Quantity, open as open_files};
use crate::power::MeterError;
use crate::power::adapter::vendor;
use crate::power::meter::MeterKind;
use crate::power::root::{Fault, SysRoot};

const AMD_NAME: &str = "amdgpu";
const INTEL_NAME: &str = "intel-gpu";
const EXPECTED: &str = "a card, such as card0, or a PCI address, such as 0000:03:00.0";
const REMEDY: &str = "give this user access to the card's folder, in a container too";
/// Microjoules at which a 32-bit counter starts again.
const RANGE_32: i64 = 1 << 32;

pub(crate) const AMD: MeterKind = MeterKind {
    name: AMD_NAME,
    usage: "amdgpu[=CARD|=PCI ADDRESS]",
    expected: EXPECTED,
    open: |root, wanted| open_files(&AMD_FILES, root, wanted),
};

pub(crate) const INTEL: MeterKind = MeterKind {
    name: INTEL_NAME,
    usage: "intel-gpu[=CARD|=PCI ADDRESS]",
    expected: EXPECTED,
    open: |root, wanted| open_files(&INTEL_FILES, root, wanted),
};

static AMD_FILES: FileKind = FileKind {
    name: AMD_NAME,
    remedy: REMEDY,
    // Ten readings.
    window_seconds: 1.0,
    find: |root, wanted| amd(root, choose(root, AMD_NAME, vendor::AMD, wanted)?),
};

static INTEL_FILES: FileKind = FileKind {
    name: INTEL_NAME,
    remedy: REMEDY,
    window_seconds: 0.1,
    find: |root, wanted| intel(root, choose(root, INTEL_NAME, vendor::INTEL, wanted)?),
};

fn amd(root: &SysRoot, card: Card) -> Result<Found, MeterError> {
    let Some((monitor, _)) = card.monitors.iter().find(|(_, name)| name == "amdgpu") else {
        let reason = format!("{card} has no hardware monitor: is its driver amdgpu?");
        return Err(MeterError::unavailable(AMD_NAME, reason));
    };
    card.check(root, AMD_NAME)?;
    let mut first = None;
    for name in ["power1_average", "power1_input"] {
        let file = root.number(monitor.join(name));
        match AMD_FILES.number(root, &file, Some(&card)) {
            // One of the two may be there and never have a value.
            Ok(power) if power > 0 => {
                return Ok(Found {
                    what: format!("whole card or APU {card}, all programs, power by its driver"),
                    identity: card.to_string(),
                    parts: vec![Quantity::Power { files: vec![file], unit: 1e-6 }],
                    card: Some(card),
                });
            }
            Ok(power) => {
                let fault = format!("{} reads {power} µW", file.path().display());
                first = first.or(Some(MeterError::broken(AMD_NAME, fault)));
            }
            Err(_) if file.read() == Err(Fault::Gone) => {}
            Err(error) => first = first.or(Some(error)),
        }
    }
    let absent = || {
        let reason = format!("{} has neither power1_average nor power1_input", monitor.display());
        MeterError::unavailable(AMD_NAME, reason)
    };
    Err(first.unwrap_or_else(absent))
}

fn intel(root: &SysRoot, card: Card) -> Result<Found, MeterError> {
    card.check(root, INTEL_NAME)?;
    let monitor = card.monitors.iter().find(|(_, name)| name == "xe" || name == "i915");
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
            "{card} has no energy counter: its driver has one for graphics cards only; rapl covers integrated GPUs"
        );
        return Err(MeterError::unavailable(INTEL_NAME, reason));
    }
    let (label, file) = channels.swap_remove(whole.unwrap_or(0));
    let part = match label.as_deref() {
        Some("card") | None => "whole card".to_owned(),
        Some("pkg") => "package of the card, without its memory,".to_owned(),
        Some(other) => format!("part \"{other}\" of the card"),
    };
    Ok(Found {
        what: format!("{part} {card}, all programs, energy counter of its driver"),
        identity: card.to_string(),
        parts: vec![Quantity::Energy { file, range: Some(RANGE_32) }],
        card: Some(card),
    })
}

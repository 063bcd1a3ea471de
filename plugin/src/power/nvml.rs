//! Energy of an NVIDIA board by NVML's energy counter (`nvmlDeviceGetTotalEnergyConsumption`).
//!
//! The board integrates its power itself, so a difference of two readings misses nothing between
//! them. NVML's power reading is a trailing mean of a second on most boards, and sampled for a part
//! of the time on some. The counter covers the whole board, with memory, regulators and fans, and
//! every process that uses it.
//!
//! Limits: Volta and newer; not on virtual GPUs. The counter updates about every 0.1 s (some
//! boards: 0.01 s), so windows under a second are inaccurate. A call takes milliseconds: never read
//! it on a thread that a frame waits for. Loading the library wakes a board that sleeps and keeps it
//! awake, so that it is not loaded for a board that does not render.

use std::time::Duration;

use bevy::platform::time::Instant;
use nvml_wrapper::Nvml;
use nvml_wrapper::error::NvmlError;

use crate::power::adapter::vendor;
use crate::power::meter::{MeterKind, Opened, Wanted};
use crate::power::root::SysRoot;
use crate::power::sysfs::cards::{Card, SLEEPS, cards, check_vendor};
use crate::power::{Adapter, MeterError, MeterInfo, PowerMeter, Provenance};
use crate::units::Joules;

const NAME: &str = "nvml";

pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: "nvml[=INDEX|=BOARD NAME]",
    expected: "a board's index from 0, or its name",
    open,
};

/// Time between two trials to load the driver's library anew, after it or the board failed.
const RELOAD_INTERVAL: Duration = Duration::from_secs(5);

/// Loads NVML and takes one reading, so that a board without the counter fails here. Takes up to some
/// hundred milliseconds. The board of an adapter is found by its PCI address, or by its name where the
/// address is unknown; without both it is the only board.
fn open(root: &SysRoot, wanted: Wanted) -> Opened {
    let adapter = match wanted {
        Wanted::For(adapter) => Some(adapter),
        Wanted::Usual | Wanted::Named(_) => None,
    };
    may_load(root, adapter)?;
    let nvml = load()?;
    let index = match wanted {
        Wanted::Usual => Some(0),
        Wanted::Named(text) => text.parse().ok(),
        // An empty address is unknown to NVML, too.
        Wanted::For(adapter) => nvml
            .device_by_pci_bus_id(adapter.pci_bus_id.as_str())
            .and_then(|device| device.index())
            .ok(),
    };
    let (index, board) = match (index, wanted) {
        (Some(index), _) => (index, board_name(&nvml, index)?),
        (None, Wanted::Named(name)) => board_named(&nvml, name)?,
        (None, Wanted::For(adapter)) if !adapter.name.is_empty() => {
            board_named(&nvml, &adapter.name)?
        }
        (None, Wanted::For(_) | Wanted::Usual) => only_board(&nvml)?,
    };
    Ok(Box::new(NvmlMeter::checked(root, nvml, index, board)?))
}

/// Whether the library may be loaded for `adapter`: not where that would start the driver of a board
/// that does not render, or that sleeps.
fn may_load(root: &SysRoot, adapter: Option<&Adapter>) -> Result<(), MeterError> {
    let all = cards(root);
    if let Some(adapter) = adapter {
        check_vendor(NAME, vendor::NVIDIA, adapter, &all)?;
    }
    let is_it = |card: &&Card| {
        let address = adapter.map_or("", |adapter| adapter.pci_bus_id.as_str());
        card.vendor == vendor::NVIDIA && (address.is_empty() || card.is_at(address))
    };
    let ours: Vec<&Card> = all.iter().filter(is_it).collect();
    if !ours.is_empty() && ours.iter().all(|card| card.is_asleep(root)) {
        return Err(MeterError::unreadable(NAME, SLEEPS));
    }
    Ok(())
}

/// Measured meter: NVML's energy counter of one board.
///
/// A reading takes milliseconds. Each reading looks the board up again, by its PCI address: a handle
/// would borrow the library, and boards are numbered anew when one goes.
#[derive(Debug)]
struct NvmlMeter {
    root: SysRoot,
    /// The board as the kernel knows it.
    card: Option<Card>,
    nvml: Result<Nvml, MeterError>,
    index: u32,
    board: String,
    /// Empty where NVML does not tell it.
    address: String,
    loaded: Instant,
}

impl NvmlMeter {
    fn checked(root: &SysRoot, nvml: Nvml, index: u32, board: String) -> Result<Self, MeterError> {
        let address = nvml.device_by_index(index).and_then(|device| device.pci_info());
        let address = address.map(|pci| pci.bus_id.to_lowercase()).unwrap_or_default();
        let (root, nvml, loaded) = (root.clone(), Ok(nvml), Instant::now());
        let card = cards(&root).into_iter().find(|card| card.is_at(&address));
        let mut meter = Self { root, card, nvml, index, board, address, loaded };
        meter.energy()?;
        Ok(meter)
    }

    fn counter(&self) -> Result<Joules, MeterError> {
        let nvml = self.nvml.as_ref().map_err(Clone::clone)?;
        let device = if self.address.is_empty() {
            nvml.device_by_index(self.index)
        } else {
            nvml.device_by_pci_bus_id(self.address.as_str())
        };
        let millijoules = device.and_then(|device| device.total_energy_consumption());
        // Exact in f64 up to 2^53 mJ: 285 years at 1 kW.
        Ok(Joules(millijoules.map_err(meter_error)? as f64 * 1e-3))
    }
}

impl PowerMeter for NvmlMeter {
    fn info(&self) -> MeterInfo {
        let at =
            if self.address.is_empty() { String::new() } else { format!(" at {}", self.address) };
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: format!("whole board {}{at}, NVML energy counter", self.board),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        if self.card.as_ref().is_some_and(|card| card.is_asleep(&self.root)) {
            return Err(MeterError::unreadable(NAME, SLEEPS));
        }
        let energy = self.counter();
        // A driver that was restarted answers a library that is loaded after it only.
        if energy.is_err() && self.loaded.elapsed() >= RELOAD_INTERVAL {
            self.loaded = Instant::now();
            self.nvml = load();
        }
        energy
    }

    fn window_seconds(&self) -> f64 {
        // Ten of the counter's updates of 0.1 s, so that a window's energy is accurate to a tenth.
        1.0
    }
}

/// Loads the driver's library. Without the development links, Linux has only the versioned name,
/// which the wrapper does not try.
fn load() -> Result<Nvml, MeterError> {
    let loaded = if cfg!(target_os = "linux") {
        Nvml::builder().lib_path("libnvidia-ml.so.1".as_ref()).init()
    } else {
        Nvml::init()
    };
    loaded.map_err(meter_error)
}

/// The machine's board, where there is one: any of several might not be the one that renders.
fn only_board(nvml: &Nvml) -> Result<(u32, String), MeterError> {
    match nvml.device_count().map_err(meter_error)? {
        0 | 1 => Ok((0, board_name(nvml, 0)?)),
        boards => Err(MeterError::unavailable(
            NAME,
            format!(
                "the rendering adapter is unknown, and there are {boards} boards: name one as nvml=INDEX"
            ),
        )),
    }
}

fn board_name(nvml: &Nvml, index: u32) -> Result<String, MeterError> {
    let count = nvml.device_count().map_err(meter_error)?;
    if index >= count {
        return Err(MeterError::unavailable(
            NAME,
            format!("there is no board {index}: the driver reports {count}"),
        ));
    }
    nvml.device_by_index(index).and_then(|device| device.name()).map_err(meter_error)
}

/// Index and name of the board with this name.
fn board_named(nvml: &Nvml, name: &str) -> Result<(u32, String), MeterError> {
    let count = nvml.device_count().map_err(meter_error)?;
    let boards = (0..count).map(|index| board_name(nvml, index)).collect::<Result<Vec<_>, _>>()?;
    let index = only_named(&boards, name).map_err(|why| MeterError::unavailable(NAME, why))?;
    Ok((index as u32, boards[index].clone()))
}

/// Index of the only one of `boards` with this name: of two equal ones, either might not be the one that
/// renders.
fn only_named(boards: &[String], name: &str) -> Result<usize, String> {
    let is_named = |index: &usize| plain_name(&boards[*index]) == plain_name(name);
    let named: Vec<usize> = (0..boards.len()).filter(is_named).collect();
    match named[..] {
        [index] => Ok(index),
        [] => Err(format!(
            "no NVIDIA board is called \"{name}\"; there is: {}",
            if boards.is_empty() { "none".to_owned() } else { boards.join(", ") }
        )),
        _ => Err(format!(
            "there are {} boards called \"{name}\": name one as nvml=INDEX",
            named.len()
        )),
    }
}

/// A board's name without the parts that differ between drivers and APIs: "NVIDIA GeForce RTX
/// 3080/PCIe/SSE2" is "geforce rtx 3080".
fn plain_name(name: &str) -> String {
    let lower = name.split('/').next().unwrap_or_default().to_lowercase();
    lower.split_whitespace().filter(|word| *word != "nvidia").collect::<Vec<_>>().join(" ")
}

fn meter_error(error: NvmlError) -> MeterError {
    match error {
        NvmlError::NotSupported
        | NvmlError::FunctionNotFound
        | NvmlError::FailedToLoadSymbol(_) => MeterError::unavailable(
            NAME,
            format!(
                "{error}: the energy counter needs a Volta or newer board that is not a virtual GPU, and driver 410 or newer; choose another meter"
            ),
        ),
        NvmlError::LibloadingError(_) | NvmlError::LibraryNotFound => MeterError::unavailable(
            NAME,
            format!(
                "no NVIDIA driver library ({error}); install the driver where there is an NVIDIA board"
            ),
        ),
        NvmlError::DriverNotLoaded => MeterError::unavailable(
            NAME,
            format!("{error}; load it, or restart after its installation"),
        ),
        NvmlError::LibRmVersionMismatch => MeterError::unavailable(
            NAME,
            format!("{error}; restart the machine: the driver was updated while it ran"),
        ),
        NvmlError::NotFound | NvmlError::InvalidArg => {
            MeterError::unavailable(NAME, format!("the board is missing: {error}"))
        }
        NvmlError::NoPermission => MeterError::unreadable(
            NAME,
            format!("{error}; allow this user the /dev/nvidia* devices, in a container too"),
        ),
        _ => MeterError::unreadable(NAME, error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_compared_without_decoration() {
        assert_eq!(plain_name("NVIDIA GeForce RTX 3080/PCIe/SSE2"), plain_name("GeForce RTX 3080"));
        assert_ne!(plain_name("NVIDIA GeForce RTX 3080"), plain_name("NVIDIA GeForce RTX 3080 Ti"));
    }

    #[test]
    fn of_equal_boards_none_is_taken_by_its_name() {
        let boards = ["NVIDIA RTX A4000", "NVIDIA H200", "NVIDIA RTX A4000"].map(str::to_owned);
        assert_eq!(only_named(&boards, "H200"), Ok(1));
        let why = |name| only_named(&boards, name).expect_err("no one board");
        assert!(why("RTX A4000").contains("there are 2 boards"), "{}", why("RTX A4000"));
        assert!(why("RTX A4000").contains("nvml=INDEX"), "{}", why("RTX A4000"));
        assert!(why("GTX 970").contains("there is: NVIDIA RTX A4000, "), "{}", why("GTX 970"));
    }

    #[test]
    fn a_missing_feature_is_unavailable_and_a_rejected_query_unreadable() {
        let unsupported = meter_error(NvmlError::NotSupported);
        assert!(
            matches!(unsupported, MeterError::Unavailable { .. })
                && unsupported.to_string().contains("choose another meter")
        );
        assert!(matches!(meter_error(NvmlError::DriverNotLoaded), MeterError::Unavailable { .. }));
        assert!(matches!(meter_error(NvmlError::NoPermission), MeterError::Unreadable { .. }));
        assert!(matches!(meter_error(NvmlError::GpuLost), MeterError::Unreadable { .. }));
    }

    /// With a board, its counter is readable or gives a reason; without one, opening returns an
    /// error.
    #[test]
    fn opening_never_panics() {
        fn opened(wanted: Wanted) -> Opened {
            open(&SysRoot::default(), wanted)
        }
        match opened(Wanted::Usual) {
            Ok(mut meter) => {
                assert!(meter.energy().expect("it was read when it was opened").0 >= 0.0);
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
        assert!(opened(Wanted::Named(&u32::MAX.to_string())).is_err());
        assert!(opened(Wanted::Named("no such board")).is_err());
    }
}

//! The graphics cards that the kernel knows, and the choice of the one that renders.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;

use crate::power::adapter::RENDERS_ON_CPU;
use crate::power::meter::Wanted;
use crate::power::root::SysRoot;
use crate::power::{Adapter, AdapterKind, MeterError};

/// Why a card that is asleep is not read.
pub(crate) const SLEEPS: &str = "the GPU sleeps (runtime suspended)";

/// A graphics card with the hardware monitors of its driver.
#[derive(Clone, Debug)]
pub(crate) struct Card {
    /// `card0`…, which may be another one after a restart.
    name: String,
    pub vendor: u32,
    device: u32,
    /// `0000:03:00.0`; empty where unknown.
    address: String,
    /// Folder of the device.
    folder: PathBuf,
    /// Folders of its monitors, with the monitors' names.
    pub monitors: Vec<(PathBuf, String)>,
}

impl Display for Card {
    /// A name that stays: the address, or the model.
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        if self.address.is_empty() {
            write!(formatter, "{:04x}:{:04x}", self.vendor, self.device)
        } else {
            formatter.write_str(&self.address)
        }
    }
}

impl Card {
    pub(crate) fn is_at(&self, address: &str) -> bool {
        parsed(address).is_some_and(|address| parsed(&self.address) == Some(address))
    }

    fn state(&self, root: &SysRoot) -> Option<String> {
        // Neither file wakes the card.
        let runtime = root.word(&self.folder.join("power/runtime_status"));
        runtime.or_else(|| root.word(&self.folder.join("power_state")))
    }

    /// Whether its driver says that it sleeps.
    pub(crate) fn is_asleep(&self, root: &SysRoot) -> bool {
        let state = self.state(root);
        matches!(state.as_deref(), Some("suspended" | "suspending" | "D3hot" | "D3cold"))
    }

    /// Whether its driver says that it does not.
    pub(super) fn is_awake(&self, root: &SysRoot) -> bool {
        matches!(self.state(root).as_deref(), Some("active" | "D0"))
    }

    /// Whether its files can be read without waking it, and are still its own.
    pub(super) fn check(&self, root: &SysRoot, meter: &str) -> Result<(), MeterError> {
        let address = address_in(root, &self.folder);
        if !address.is_empty() && address != self.address {
            let reason = format!("{} is no longer card {self}", self.folder.display());
            return Err(MeterError::unreadable(meter, reason));
        }
        if self.is_asleep(root) { Err(MeterError::unreadable(meter, SLEEPS)) } else { Ok(()) }
    }
}

/// The PCI address of a device; empty where unknown.
fn address_in(root: &SysRoot, device: &std::path::Path) -> String {
    let events = root.text(&device.join("uevent")).unwrap_or_default();
    let address = events.lines().find_map(|line| line.strip_prefix("PCI_SLOT_NAME="));
    address.unwrap_or_default().trim().to_owned()
}

/// All cards.
pub(crate) fn cards(root: &SysRoot) -> Vec<Card> {
    let folders = root.numbered(&root.path("sys/class/drm"), "card");
    let card = |folder: PathBuf| {
        let device = folder.join("device");
        let identifier = |file: &str| {
            let text = root.word(&device.join(file)).unwrap_or_default();
            u32::from_str_radix(text.trim_start_matches("0x"), 16).unwrap_or(0)
        };
        Card {
            name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            vendor: identifier("vendor"),
            device: identifier("device"),
            address: address_in(root, &device),
            monitors: root.named(&device.join("hwmon"), "hwmon"),
            folder: device,
        }
    };
    folders.into_iter().map(card).collect()
}

/// A PCI address as numbers; drivers write the domain with four or eight digits, or not at all.
fn parsed(address: &str) -> Option<[u32; 4]> {
    let (rest, function) = address.trim().rsplit_once('.')?;
    let mut parts = rest.rsplit(':').map(|part| u32::from_str_radix(part, 16).ok());
    let (device, bus, domain) = (parts.next()??, parts.next()??, parts.next().unwrap_or(Some(0))?);
    Some([domain, bus, device, u32::from_str_radix(function, 16).ok()?])
}

fn named(cards: &[&Card]) -> String {
    let names = cards.iter().map(|card| format!("{} ({})", card.name, card.address));
    names.collect::<Vec<_>>().join(", ")
}

/// The vendor's card that is wanted.
pub(super) fn choose(
    root: &SysRoot,
    meter: &'static str,
    vendor: u32,
    wanted: Wanted,
) -> Result<Card, MeterError> {
    let wanted = match wanted {
        Wanted::For(adapter) => return choose_for(root, meter, vendor, adapter),
        Wanted::Named(name) => Some(name),
        Wanted::Usual => None,
    };
    let all = cards(root);
    let ours: Vec<&Card> = all.iter().filter(|card| card.vendor == vendor).collect();
    let is_wanted = |card: &&&Card| {
        wanted.is_some_and(|wanted| {
            card.name == wanted || card.is_at(wanted) || card.to_string() == wanted
        })
    };
    match (wanted, ours.iter().find(is_wanted), &ours[..]) {
        (Some(_), Some(card), _) => Ok((*card).clone()),
        (None, _, [card]) => Ok((*card).clone()),
        (_, _, []) => Err(none(root, meter)),
        (Some(wanted), ..) => Err(MeterError::unavailable(
            meter,
            format!("there is no card \"{wanted}\" of this vendor; there is: {}", named(&ours)),
        )),
        (None, ..) => Err(ambiguous(meter, &ours)),
    }
}

/// Fails where an adapter is none of this vendor's cards, or may be one of several.
pub(crate) fn check_vendor(
    meter: &str,
    vendor: u32,
    adapter: &Adapter,
    all: &[Card],
) -> Result<(), MeterError> {
    let reason = match adapter.vendor() {
        _ if adapter.kind == AdapterKind::Software => RENDERS_ON_CPU,
        Some(other) if other != vendor => "the adapter is another vendor's",
        None if all.len() > 1 => {
            "the adapter is unknown, and there are several cards: name one after ="
        }
        None if all.iter().any(|card| card.vendor != vendor) => {
            "the machine's card is another vendor's"
        }
        _ => return Ok(()),
    };
    Err(MeterError::unavailable(meter, reason))
}

/// The vendor's card that is the rendering adapter.
fn choose_for(
    root: &SysRoot,
    meter: &'static str,
    vendor: u32,
    adapter: &Adapter,
) -> Result<Card, MeterError> {
    let all = cards(root);
    check_vendor(meter, vendor, adapter, &all)?;
    let ours: Vec<&Card> = all.iter().filter(|card| card.vendor == vendor).collect();
    if ours.is_empty() {
        return Err(none(root, meter));
    }
    if let Some(address) = parsed(&adapter.pci_bus_id) {
        let found = ours.iter().find(|card| parsed(&card.address) == Some(address));
        if let Some(card) = found {
            return Ok((*card).clone());
        }
        if ours.iter().any(|card| !card.address.is_empty()) {
            let there = named(&ours);
            let reason = format!("no card at {}; there is: {there}", adapter.pci_bus_id);
            return Err(MeterError::unavailable(meter, reason));
        }
    }
    let same: Vec<&Card> = ours.iter().filter(|c| c.device == adapter.device_id).copied().collect();
    match (&same[..], &ours[..]) {
        ([card], _) => Ok((*card).clone()),
        ([], [card]) if adapter.device_id == 0 || card.device == 0 => Ok((*card).clone()),
        ([], [_]) => Err(MeterError::unavailable(meter, "the adapter is another model")),
        _ => Err(ambiguous(meter, &ours)),
    }
}

fn none(root: &SysRoot, meter: &str) -> MeterError {
    let folder = root.path("sys/class/drm");
    MeterError::unavailable(meter, format!("no card of this vendor in {}", folder.display()))
}

fn ambiguous(meter: &str, cards: &[&Card]) -> MeterError {
    MeterError::unavailable(
        meter,
        format!("several cards could be the adapter: name one of {} after =", named(cards)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_equal_whatever_their_digits() {
        assert_eq!(parsed("0000:03:00.0"), Some([0, 3, 0, 0]));
        assert_eq!(parsed("00000000:03:00.0"), parsed("03:00.0"));
        assert_eq!(parsed("0001:C1:1f.7"), Some([1, 0xc1, 0x1f, 7]));
        for odd in ["", "card0", "3", "x:03:00.0", "03:00.", "..", ":::"] {
            assert_eq!(parsed(odd), None, "{odd}");
        }
    }
}

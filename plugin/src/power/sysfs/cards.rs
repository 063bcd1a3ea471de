//! The graphics cards that the kernel knows, and the choice of the one that renders.

use std::path::PathBuf;

use super::SysRoot;
use crate::power::adapter::RENDERS_ON_CPU;
use crate::power::{Adapter, AdapterKind, MeterError};

/// A graphics card with the hardware monitors of its driver.
#[derive(Clone, Debug)]
pub(super) struct Card {
    /// `card0`…
    pub name: String,
    vendor: u32,
    device: u32,
    /// `0000:03:00.0`; empty where unknown.
    pub address: String,
    /// Folders of its monitors, with the monitors' names.
    pub monitors: Vec<(PathBuf, String)>,
}

/// Numbers in a name after `prefix`.
fn is_numbered(name: &str, prefix: &str) -> bool {
    let number = name.strip_prefix(prefix);
    number.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit()))
}

/// All cards.
pub(super) fn cards(root: &SysRoot) -> Vec<Card> {
    let folders = root.list(&root.path("sys/class/drm"), |name| is_numbered(name, "card"));
    let card = |folder: PathBuf| {
        let device = folder.join("device");
        let identifier = |file: &str| {
            let text = root.word(&device.join(file)).unwrap_or_default();
            u32::from_str_radix(text.trim_start_matches("0x"), 16).unwrap_or(0)
        };
        let events = root.text(&device.join("uevent")).unwrap_or_default();
        let address = events.lines().find_map(|line| line.strip_prefix("PCI_SLOT_NAME="));
        let named = |monitor: PathBuf| {
            let name = root.word(&monitor.join("name"))?;
            Some((monitor, name))
        };
        let monitors = root.list(&device.join("hwmon"), |name| is_numbered(name, "hwmon"));
        Card {
            name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            vendor: identifier("vendor"),
            device: identifier("device"),
            address: address.unwrap_or_default().trim().to_owned(),
            monitors: monitors.into_iter().filter_map(named).collect(),
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

/// The vendor's card that `wanted` names by card or address; without it the only one.
pub(super) fn choose(
    root: &SysRoot,
    meter: &'static str,
    vendor: u32,
    wanted: Option<&str>,
) -> Result<Card, MeterError> {
    let all = cards(root);
    let ours: Vec<&Card> = all.iter().filter(|card| card.vendor == vendor).collect();
    let found = ours.iter().find(|card| {
        wanted.is_some_and(|wanted| {
            card.name == wanted
                || (parsed(wanted).is_some() && parsed(wanted) == parsed(&card.address))
        })
    });
    match (wanted, found, &ours[..]) {
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

/// The vendor's card that is the rendering adapter.
pub(super) fn choose_for(
    root: &SysRoot,
    meter: &'static str,
    vendor: u32,
    adapter: &Adapter,
) -> Result<Card, MeterError> {
    let unsuitable = |reason: &str| Err(MeterError::unavailable(meter, reason));
    if adapter.kind == AdapterKind::Software {
        return unsuitable(RENDERS_ON_CPU);
    }
    if adapter.vendor().is_some_and(|other| other != vendor) {
        return unsuitable("the adapter is another vendor's");
    }
    let all = cards(root);
    let ours: Vec<&Card> = all.iter().filter(|card| card.vendor == vendor).collect();
    if ours.is_empty() {
        return Err(none(root, meter));
    }
    if adapter.vendor().is_none() && all.len() > 1 {
        return unsuitable("the adapter is unknown, and there are several cards: name one");
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
        ([], [_]) => unsuitable("the adapter is another model"),
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

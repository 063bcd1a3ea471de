//! Which device watts are of: power that two devices draw does not compare, and does not mix.

use bevy_frugal_gi::power::{Adapter, AdapterKind};
use frugal_core::power::MeterInfo;

use crate::work_meter::is_work_meter;

/// Before the device in a meter's description.
const ON: &str = "; on ";

/// What the system says of a processor's model, by architecture.
#[cfg(target_os = "linux")]
const CPU_FIELDS: [&str; 7] =
    ["model name", "Model", "Hardware", "CPU implementer", "CPU part", "cpu model", "uarch"];

/// `meter` with this machine's devices in its description, unless its watts are the same everywhere.
/// `adapter`: what renders.
pub(crate) fn on_this_machine(meter: MeterInfo, adapter: Option<Adapter>) -> MeterInfo {
    if is_work_meter(&meter.name).is_some() {
        return meter;
    }
    let adapter = adapter.filter(|adapter| adapter.kind != AdapterKind::Software);
    let adapter = adapter.map_or_else(String::new, |adapter| format!(" with {}", adapter.name));
    let description = format!("{}{ON}{}{adapter}", meter.description, processor());
    MeterInfo { description, ..meter }
}

/// The model of this machine's processor.
pub(crate) fn processor() -> String {
    let found = system_processor().unwrap_or_default();
    let found = found.split_whitespace().collect::<Vec<_>>().join(" ");
    if found.is_empty() { format!("a processor of {}", std::env::consts::ARCH) } else { found }
}

#[cfg(target_os = "linux")]
fn system_processor() -> Option<String> {
    Some(model_in(&std::fs::read_to_string("/proc/cpuinfo").ok()?))
}

/// Each model that `cpuinfo` names, once.
#[cfg(target_os = "linux")]
fn model_in(cpuinfo: &str) -> String {
    let mut models: Vec<&str> = Vec::new();
    for (field, value) in cpuinfo.lines().filter_map(|line| line.split_once(':')) {
        let value = value.trim();
        if CPU_FIELDS.contains(&field.trim()) && !value.is_empty() && !models.contains(&value) {
            models.push(value);
        }
    }
    models.join(", ")
}

#[cfg(target_os = "macos")]
fn system_processor() -> Option<String> {
    let mut sysctl = std::process::Command::new("sysctl");
    let output = sysctl.args(["-n", "machdep.cpu.brand_string"]).output().ok()?;
    String::from_utf8(output.stdout).ok()
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn system_processor() -> Option<String> {
    std::env::var("PROCESSOR_IDENTIFIER").ok()
}

/// The kind of the meter of that name: the name without an option, such as a card or a file of prices.
pub(crate) fn kind(name: &str) -> &str {
    name.split('=').next().unwrap_or_default().trim()
}

/// The device that a meter reads, the same after each start of the system: its PCI address where the
/// description has one, else the description without the numbers that the system deals out anew.
pub(crate) fn stable_device(meter: &MeterInfo) -> String {
    let (what, _) = parts(meter);
    pci_address(what).map_or_else(|| without_numbers(what), |address| format!("PCI {address}"))
}

/// Whether the watts of two meters are of one device or model. A machine that one of them does not name
/// counts as that of the other.
pub(crate) fn is_same(a: &MeterInfo, b: &MeterInfo) -> bool {
    let machines = match (parts(a).1, parts(b).1) {
        (Some(a), Some(b)) => a == b,
        _ => true,
    };
    machines && kind(&a.name) == kind(&b.name) && stable_device(a) == stable_device(b)
}

/// What a meter reads, and the machine that it does so on.
fn parts(meter: &MeterInfo) -> (&str, Option<&str>) {
    match meter.description.split_once(ON) {
        Some((what, machine)) => (what, Some(machine)),
        None => (&meter.description, None),
    }
}

/// The first PCI address in `text`, as `0000:03:00.0`.
fn pci_address(text: &str) -> Option<String> {
    let words =
        text.split(|letter: char| !(letter.is_ascii_alphanumeric() || ":.".contains(letter)));
    words.map(|word| word.trim_end_matches(['.', ':'])).find_map(|word| {
        let parts: Vec<&str> = word.split([':', '.']).collect();
        let [domain, bus, device, function] = parts[..] else { return None };
        let is_hex = parts.concat().bytes().all(|byte| byte.is_ascii_hexdigit());
        let lengths = [bus, device, function].map(str::len);
        let is_address = is_hex && (4..=8).contains(&domain.len()) && lengths == [2, 2, 1];
        let domain = u32::from_str_radix(domain, 16).ok().filter(|_| is_address)?;
        Some(format!("{domain:04x}:{bus}:{device}.{function}").to_lowercase())
    })
}

/// `text` without the numbers of cards, monitors, boards and batteries.
fn without_numbers(text: &str) -> String {
    const DEALT: [&str; 5] = ["card", "hwmon", "renderD", "BAT", "iio:device"];
    let mut stable: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let bare = word.trim_end_matches(|letter: char| !letter.is_alphanumeric());
        let (name, rest) =
            (bare.trim_end_matches(|digit: char| digit.is_ascii_digit()), &word[bare.len()..]);
        let is_index = name.is_empty() && !bare.is_empty();
        let is_of_board =
            stable.last().is_some_and(|last| ["board", "device", "GPU"].contains(&last.as_str()));
        if is_index && is_of_board {
            continue;
        }
        let is_dealt =
            DEALT.contains(&name.trim_start_matches(|letter: char| !letter.is_alphanumeric()));
        stable.push(if is_dealt { format!("{name}{rest}") } else { word.to_owned() });
    }
    stable.join(" ")
}

#[cfg(test)]
mod tests {
    use frugal_core::power::Provenance;

    use super::*;

    fn meter(name: &str, description: &str) -> MeterInfo {
        MeterInfo {
            name: name.to_owned(),
            provenance: Provenance::Measured,
            description: description.to_owned(),
        }
    }

    #[test]
    fn a_device_is_the_same_whatever_its_number() {
        for (a, b, same) in [
            (
                "whole card or APU 0000:04:00.0 (card1, PPT), all programs, power1_average of its driver",
                "whole card or APU 0000:04:00.0 (card0, slowPPT), all programs, power1_input of its driver",
                true,
            ),
            ("whole card 0000:04:00.0 (card1)", "whole card 0000:0b:00.0 (card1)", false),
            ("whole board, PCI 00000000:0B:00.0", "whole board, PCI 0000:0b:00.0.", true),
            ("whole board 0 (RTX 4090), NVML", "whole board 1 (RTX 4090), NVML", true),
            ("whole board 0 (RTX 4090), NVML", "whole board 0 (RTX 4080), NVML", false),
            ("card1 (hwmon3), its driver", "card0 (hwmon7), its driver", true),
            ("CPU time × 3.5 W per busy core", "CPU time × 5 W per busy core", false),
            ("rail VDD_IN, whole module", "rail VDD_CPU, whole module", false),
            ("package-0; on Intel N100", "package-0; on AMD Ryzen 5", false),
            ("package-0; on Intel N100", "package-0", true),
            ("PCI 0000:03:00.0; on Intel N100", "PCI 0000:03:00.0; on AMD Ryzen 5", false),
        ] {
            let (a, b) = (meter("nvml=0", a), meter("nvml=1", b));
            assert_eq!((is_same(&a, &b), is_same(&b, &a)), (same, same), "{a:?} and {b:?}");
            assert!(is_same(&a, &a) && !is_same(&a, &meter("rapl", &a.description)));
        }
    }

    #[test]
    fn counted_work_is_the_same_everywhere_and_all_else_names_the_machine() {
        let work =
            meter("work=a.prices.ron", "work of each frame at the prices of llvmpipe (00ff)");
        assert_eq!(on_this_machine(work.clone(), None), work);
        let time = on_this_machine(meter("cpu-time", "CPU time"), None);
        assert!(time.description.contains(&processor()), "{time:?}");
        assert_eq!(stable_device(&time), "CPU time");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_processor_is_read_on_every_architecture() {
        let x86 = "processor\t: 0\nmodel name\t: AMD EPYC\ncpu MHz\t\t: 2445.4\nprocessor\t: 1\nmodel name\t: AMD EPYC\n";
        assert_eq!(model_in(x86), "AMD EPYC");
        let arm = "CPU implementer\t: 0x41\nCPU part\t: 0xd05\n\nCPU implementer\t: 0x41\nCPU part\t: 0xd0b\n";
        assert_eq!(model_in(arm), "0x41, 0xd05, 0xd0b");
        assert_eq!(model_in("nothing"), "");
        assert!(!processor().is_empty());
    }
}

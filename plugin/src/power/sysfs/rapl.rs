//! Energy of processor packages by RAPL, as Linux' power capping shows it. Intel's and AMD's
//! processors have it.
//!
//! `intel-rapl:N` is a package, or `psys`, the whole platform; `intel-rapl:N:M` is a part of a
//! package (`core`, `uncore`), which the package contains. `intel-rapl-mmio:N` is the same package
//! once more. Packages are added up, and nothing else.

use super::{FileKind, Found, Quantity, open as open_files};
use crate::power::MeterError;
use crate::power::meter::{MeterKind, Wanted};
use crate::power::root::SysRoot;

const NAME: &str = "rapl";
const FOLDER: &str = "sys/class/powercap";

pub(crate) const KIND: MeterKind = MeterKind {
    name: NAME,
    usage: "rapl[=package|=psys]",
    expected: "package or psys",
    open: |root, wanted| open_files(&FILES, root, wanted),
};

static FILES: FileKind = FileKind {
    name: NAME,
    remedy: "these counters are the administrator's since they tell secrets of other programs; \
         `sudo chmod a+r /sys/class/powercap/intel-rapl:*/energy_uj` opens them until the next start",
    // A hundred of the counters' updates of a millisecond.
    window_seconds: 0.1,
    find,
};

fn find(root: &SysRoot, wanted: Wanted) -> Result<Found, MeterError> {
    let domain = match wanted {
        Wanted::Usual => "package",
        Wanted::Named(domain @ ("package" | "psys")) => domain,
        Wanted::Named(other) => {
            return Err(MeterError::unavailable(
                NAME,
                format!("there is no domain \"{other}\": give package or psys"),
            ));
        }
        Wanted::For(adapter) => {
            adapter.is_part_of(NAME, "the processor's package")?;
            "package"
        }
    };
    let folder = root.path(FOLDER);
    let mut domains = Vec::new();
    for found in root.numbered(&folder, "intel-rapl:") {
        let Some(name) = root.word(&found.join("name")) else { continue };
        if name.starts_with(domain) && domains.iter().all(|(other, _)| *other != name) {
            let range = root.number(found.join("max_energy_range_uj")).read().ok();
            let file = root.number(found.join("energy_uj"));
            domains.push((name, Quantity::Energy { file, range }));
        }
    }
    if domains.is_empty() {
        return Err(MeterError::unavailable(
            NAME,
            format!(
                "no {domain} domain in {}: the processor has none, or the kernel module intel_rapl_msr is not loaded",
                folder.display()
            ),
        ));
    }
    domains.sort_by(|one, other| one.0.cmp(&other.0));
    let (names, parts): (Vec<_>, _) = domains.into_iter().unzip();
    Ok(Found {
        what: format!(
            "{} with all programs and the integrated GPU, RAPL energy counters",
            names.join(" + ")
        ),
        identity: domain.to_owned(),
        parts,
        card: None,
    })
}

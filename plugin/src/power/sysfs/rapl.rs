//! Energy of processor packages by RAPL, as Linux' power capping shows it. Intel's and AMD's
//! processors have it.
//!
//! `intel-rapl:N` is a package, or `psys`, the whole platform; `intel-rapl:N:M` is a part of a
//! package (`core`, `uncore`), which the package contains. `intel-rapl-mmio:N` is the same package
//! once more. Packages are added up, and nothing else.

use std::time::Duration;

use super::integrate::Counter;
use super::root::NumberFile;
use super::{Source, SourceKind, SysRoot};
use crate::power::adapter::CPU_TIME_IS_BETTER;
use crate::power::{Adapter, AdapterKind, MeterError, MeterInfo, Provenance};
use crate::units::Joules;

const NAME: &str = "rapl";
const FOLDER: &str = "sys/class/powercap";
const REMEDY: &str = "these counters are the administrator's since they tell secrets of other programs; \
     `sudo chmod a+r /sys/class/powercap/intel-rapl:*/energy_uj` opens them until the next start";

pub(crate) const KIND: SourceKind = SourceKind {
    name: NAME,
    usage: "rapl[=package|=psys]",
    expected: "package or psys",
    find: |root, parameter| find(root, parameter.unwrap_or("package")),
    find_for,
};

/// The counters of all packages, or of the platform.
struct Rapl {
    domains: Vec<(NumberFile, Counter)>,
    names: Vec<String>,
}

fn find(root: &SysRoot, wanted: &str) -> Result<Box<dyn Source>, MeterError> {
    if !["package", "psys"].contains(&wanted) {
        return Err(MeterError::unavailable(
            NAME,
            format!("there is no domain \"{wanted}\": give package or psys"),
        ));
    }
    let folder = root.path(FOLDER);
    let mut rapl = Rapl { domains: Vec::new(), names: Vec::new() };
    let is_domain =
        |name: &str| name.strip_prefix("intel-rapl:").is_some_and(|rest| !rest.contains(':'));
    for domain in root.list(&folder, is_domain) {
        let Some(name) = root.word(&domain.join("name")) else { continue };
        if !name.starts_with(wanted) || rapl.names.contains(&name) {
            continue;
        }
        let range = root.number(domain.join("max_energy_range_uj")).read().ok();
        rapl.domains.push((root.number(domain.join("energy_uj")), Counter::new(range)));
        rapl.names.push(name);
    }
    if rapl.domains.is_empty() {
        return Err(MeterError::unavailable(
            NAME,
            format!(
                "no {wanted} domain in {}: the processor has none, or the kernel module intel_rapl_msr is not loaded",
                folder.display()
            ),
        ));
    }
    Ok(Box::new(rapl))
}

fn find_for(root: &SysRoot, adapter: &Adapter) -> Result<Box<dyn Source>, MeterError> {
    let reason = match adapter.kind {
        AdapterKind::Hardware if adapter.is_integrated => return find(root, "package"),
        AdapterKind::Hardware => "the GPU is not part of the processor's package",
        AdapterKind::Software => CPU_TIME_IS_BETTER,
        AdapterKind::Unknown => {
            "the adapter is not known to be part of the processor's package; request it by name"
        }
    };
    Err(MeterError::unavailable(NAME, reason))
}

impl Source for Rapl {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: NAME.to_owned(),
            provenance: Provenance::Measured,
            description: format!(
                "{} with all programs and the integrated GPU, RAPL energy counters",
                self.names.join(" + ")
            ),
        }
    }

    fn window_seconds(&self) -> f64 {
        // A hundred of the counters' updates of a millisecond.
        0.1
    }

    fn poll(&self) -> Duration {
        // Often enough for every wrap: 65 kJ, the least range, last minutes.
        Duration::from_secs(1)
    }

    fn energy_at(&mut self, at: Duration) -> Result<Option<Joules>, MeterError> {
        let mut sum = Some(Joules(0.0));
        let mut failed = None;
        for (file, counter) in &mut self.domains {
            match counter.add(NAME, file.reading(NAME, REMEDY), at) {
                Ok(energy) => sum = sum.zip(energy).map(|(sum, energy)| sum + energy),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        failed.map_or(Ok(sum), Err)
    }
}

//! Meters of handhelds and laptops: files that the Linux kernel provides under a root folder.
//!
//! | file | job |
//! |---|---|
//! | `mod` | one reader for meters that are numbers in files |
//! | `rapl`, `gpu`, `jetson` | which files these are, and of which device |
//! | `cards` | graphics cards, and the choice of the one that renders |
//! | `battery` | batteries and chargers, whose files mean something only together |

#[cfg_attr(any(windows, target_os = "macos"), allow(dead_code))]
pub(crate) mod battery;
pub(crate) mod cards;
pub(crate) mod gpu;
pub(crate) mod jetson;
pub(crate) mod rapl;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use crate::power::meter::{Opened, Wanted};
use crate::power::root::{Fault, NumberFile, SysRoot};
use crate::power::{Count, MeterError, MeterInfo, PowerMeter, Provenance, Reading};
use crate::units::{Joules, Watts};

use cards::Card;

/// Time between two readings of a power, seconds.
const POLL_SECONDS: f64 = 0.1;

/// A quantity in files, in the kernel's units.
#[derive(Clone, Debug)]
enum Quantity {
    /// A counter of microjoules that starts again after `range` of them.
    Energy { file: NumberFile, range: Option<i64> },
    /// A power: the product of the numbers, times watts.
    Power { files: Vec<NumberFile>, unit: f64 },
}

/// The files of a device.
#[derive(Clone, Debug)]
struct Found {
    /// What they cover, by names that stay the same from one start of the machine to the next.
    pub what: String,
    /// The parameter after `=` by which the same device is found again, whatever its numbers are
    /// then.
    pub identity: String,
    /// Quantities of one kind, which are added up.
    pub parts: Vec<Quantity>,
    /// The graphics card, which may sleep.
    pub card: Option<Card>,
}

/// A kind of meter in files.
struct FileKind {
    pub name: &'static str,
    /// What to do where access is denied.
    pub remedy: &'static str,
    pub window_seconds: f64,
    pub find: fn(&SysRoot, Wanted) -> Result<Found, MeterError>,
}

/// A meter in files.
struct FileMeter {
    kind: &'static FileKind,
    root: SysRoot,
    found: Found,
}

/// Opens a meter of `kind`.
fn open(kind: &'static FileKind, root: &SysRoot, wanted: Wanted) -> Opened {
    let found = (kind.find)(root, wanted)?;
    Ok(Box::new(FileMeter { kind, root: root.clone(), found }))
}

impl FileKind {
    /// The number in a file that belongs to `card`, if there is one.
    fn number(
        &self,
        root: &SysRoot,
        file: &NumberFile,
        card: Option<&Card>,
    ) -> Result<i64, MeterError> {
        file.read().map_err(|fault| match (&fault, card) {
            (Fault::Refused(_), Some(_)) => self.asleep(),
            (Fault::Busy(_), Some(card)) if !card.is_awake(root) => self.asleep(),
            _ => file.error(self.name, fault, self.remedy),
        })
    }

    fn asleep(&self) -> MeterError {
        MeterError::unreadable(self.name, cards::SLEEPS)
    }
}

impl FileMeter {
    fn quantities(&self) -> Result<Reading, MeterError> {
        let card = self.found.card.as_ref();
        if let Some(card) = card {
            card.check(&self.root, self.kind.name)?;
        }
        let number = |file: &NumberFile| self.kind.number(&self.root, file, card);
        let (mut counts, mut sum) = (Vec::new(), 0.0);
        for part in &self.found.parts {
            match part {
                Quantity::Energy { file, range } => {
                    let value = number(file)?;
                    if value < 0 {
                        let reason = format!("the counter reads {value} µJ");
                        return Err(MeterError::broken(self.kind.name, reason));
                    }
                    let joules = |microjoules: i64| Joules(microjoules as f64 * 1e-6);
                    let range = range.filter(|range| *range > 0).map(joules);
                    counts.push(Count { energy: joules(value), range });
                }
                Quantity::Power { files, unit } => {
                    let mut product = *unit;
                    for file in files {
                        let value = number(file)? as f64;
                        // Two faults of sign would make a power.
                        product *= if value < 0.0 && files.len() > 1 { f64::NAN } else { value };
                    }
                    sum += product;
                }
            }
        }
        Ok(if counts.is_empty() {
            Reading::Power { power: Watts(sum), sign_of_life: None }
        } else {
            Reading::Energy(counts)
        })
    }
}

impl PowerMeter for FileMeter {
    fn info(&self) -> MeterInfo {
        MeterInfo {
            name: self.kind.name.to_owned(),
            provenance: Provenance::Measured,
            description: self.found.what.clone(),
        }
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        self.read()?.energy(self.kind.name)
    }

    fn read(&mut self) -> Result<Reading, MeterError> {
        self.quantities().inspect_err(|_| {
            // Another driver, or the same one loaded again, has other numbers.
            let again = (self.kind.find)(&self.root, Wanted::Named(&self.found.identity));
            if let Some(found) = again.ok().filter(|found| found.what == self.found.what) {
                self.found = found;
            }
        })
    }

    fn window_seconds(&self) -> f64 {
        self.kind.window_seconds
    }

    fn poll_seconds(&self) -> f64 {
        let is_power = matches!(self.found.parts.first(), Some(Quantity::Power { .. }));
        if is_power { POLL_SECONDS } else { f64::INFINITY }
    }
}

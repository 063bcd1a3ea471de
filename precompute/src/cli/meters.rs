//! `frugal meters`: the power meters of this machine.

use bevy_frugal_gi::power::{Provenance, Verdict, busy_cpu_load, self_test, survey};

use super::CliError;
use crate::cost::WORK_METER;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {}

pub(super) fn run(_: &Arguments) -> Result<(), CliError> {
    for found in survey() {
        println!("{}   (--meter {})", found.name, found.usage);
        let mut meter = match found.meter {
            Ok(meter) => meter,
            Err(error) => {
                println!("  {error}");
                continue;
            }
        };
        let info = meter.info();
        let provenance = match info.provenance {
            Provenance::Measured => "measured",
            Provenance::Modelled => "modelled",
        };
        println!("  {provenance}: {}", info.description);
        println!("  unit W, window {} s", meter.window_seconds());
        let test = self_test(meter.as_mut(), &mut busy_cpu_load);
        let watts = |reading: Option<bevy_frugal_gi::units::Watts>| {
            reading.map_or("no reading".to_owned(), |watts| watts.to_string())
        };
        println!("  idle {}, under CPU load {}", watts(test.idle), watts(test.loaded));
        match test.verdict {
            Verdict::Works => println!("  works"),
            Verdict::Unresponsive => {
                println!(
                    "  does not respond to a load on the CPU, as a GPU's meter need not, and a battery's is slow"
                );
            }
            Verdict::Failed(error) => println!("  FAILED: {error}"),
        }
    }
    println!("{WORK_METER}   (--meter {WORK_METER}, {WORK_METER}=FILE; for frugal's own commands)");
    println!(
        "  modelled: the work of each frame at fixed prices; the same in every run, whatever the machine does"
    );
    Ok(())
}

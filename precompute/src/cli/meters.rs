//! `frugal meters`: the power meters of this machine.

use bevy_frugal_gi::power::{meters, open};
use bevy_frugal_gi::stage::Meter;

use super::CliError;
use crate::work_meter::WORK_METER;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {}

pub(super) fn run(_: &Arguments) -> Result<(), CliError> {
    for (name, usage) in meters() {
        println!("{name}   (--meter {usage})");
        let opened = open(name).map_err(|error| error.to_string());
        let meter = opened.and_then(|meter| Meter::new(meter).map_err(|error| error.to_string()));
        let mut meter = match meter {
            Ok(meter) => meter,
            Err(error) => {
                println!("  {error}");
                continue;
            }
        };
        println!("  {}: {}", meter.info.provenance, meter.info.description);
        println!("  unit W, window {} s", meter.window_seconds);
        match meter.self_test() {
            Ok(test) => {
                println!("  idle {}, under CPU load {}", test.idle, test.loaded);
                println!(
                    "  {}",
                    if test.responds {
                        "works"
                    } else {
                        "does not respond to a load on the CPU, as a GPU's meter need not, and a battery's is slow"
                    }
                );
            }
            Err(error) => println!("  no reading\n  FAILED: {error}"),
        }
    }
    println!("{WORK_METER}   (--meter {WORK_METER}, {WORK_METER}=FILE; for frugal's own commands)");
    println!(
        "  modelled: the work of each frame at fixed prices; the same in every run, whatever the machine does"
    );
    Ok(())
}

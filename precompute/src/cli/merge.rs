//! `frugal merge`: joins the journals of a run's shards.

use std::path::PathBuf;

use super::CliError;
use super::arguments::check_outputs;
use crate::journal::merge_journals;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// Journals of one run: MAP.0-of-4.journal, …
    #[arg(value_name = "JOURNAL", required = true)]
    journals: Vec<PathBuf>,
    /// Output of the merged journal; default: over each of the journals, so that every shard can go
    /// on
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let outputs: Vec<&PathBuf> = arguments
        .output
        .as_ref()
        .map_or_else(|| arguments.journals.iter().collect(), |output| vec![output]);
    check_outputs(outputs.iter().map(|output| Some(*output)))?;
    // All are read before the first is overwritten.
    let first = outputs[0];
    let records = merge_journals(&arguments.journals, first).map_err(CliError::usage)?;
    for output in &outputs[1..] {
        let bytes = std::fs::read(first).map_err(CliError::failed)?;
        crate::files::write_atomically(output, |file| file.write_all(&bytes))?;
    }
    println!(
        "{records} records of {} journals in {}",
        arguments.journals.len(),
        outputs.iter().map(|o| o.display().to_string()).collect::<Vec<_>>().join(", ")
    );
    Ok(())
}

//! `frugal merge`: joins the journals of a run's shards.

use std::path::PathBuf;

use super::CliError;
use super::arguments::check_outputs;
use crate::journal::{JournalError, merge_journals};

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
    let outputs = match &arguments.output {
        Some(output) => vec![output],
        None => arguments.journals.iter().collect(),
    };
    check_outputs(outputs.into_iter().map(Some))?;
    let (records, written) = merge_journals(&arguments.journals, arguments.output.as_deref())
        .map_err(|error| CliError::usage(with_advice(&error)))?;
    println!(
        "{records} records of {} journals in {}",
        arguments.journals.len(),
        written.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
    );
    Ok(())
}

fn with_advice(error: &JournalError) -> String {
    let advice = match error {
        JournalError::InUse { .. } => "wait until that has ended; a shard ends with its share",
        JournalError::OtherRun { .. } => "give the journals of one run",
        JournalError::HasRecords { .. } => {
            "give it among the journals that are merged, or give another --output"
        }
        JournalError::NotAJournal { .. } => {
            "give the journals of a run's shards, and to --output a new file"
        }
        JournalError::NoLocks { .. } => {
            "nobody can tell whether a shard still writes it: copy the journals to a local disk"
        }
        JournalError::File(_) | JournalError::Header(_) => return error.to_string(),
    };
    format!("{error}: {advice}")
}

//! `frugal merge`: joins the journals of a run's shards.

use std::path::PathBuf;

use frugal_search::journal::{JournalError, merge_journals};

use super::CliError;
use super::arguments::check_outputs;
use super::journal::whole_journal;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// Journals of one run: MAP.0-of-4.journal, …; none of them is changed
    #[arg(value_name = "JOURNAL", required = true)]
    journals: Vec<PathBuf>,
    /// Journal that gets all records; default: MAP.journal, beside the first
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let first = &arguments.journals[0];
    let beside = || {
        let name = first.file_name().unwrap_or_default().to_string_lossy();
        Some(first.with_file_name(whole_journal(&name)?))
    };
    let output = arguments.output.clone().or_else(beside).ok_or_else(|| {
        CliError::usage(format!(
            "{}: not a journal of a shard by its name: give --output",
            first.display()
        ))
    })?;
    check_outputs([Some(&output)])?;
    let records = merge_journals(&arguments.journals, &output)
        .map_err(|error| CliError::usage(with_advice(&error)))?;
    println!("{records} records in {}", output.display());
    Ok(())
}

fn with_advice(error: &JournalError) -> String {
    let advice = match error {
        JournalError::InUse { .. } => "wait until that has ended, or give another --output",
        JournalError::OtherRun { .. } => "give the journals of one run",
        JournalError::NotAJournal { .. } => {
            "give the journals of a run's shards, and to --output a new file"
        }
        _ => return error.to_string(),
    };
    format!("{error}: {advice}")
}

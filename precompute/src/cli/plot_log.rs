//! `frugal plot-log`: plots the control log of an app.

use std::path::PathBuf;

use bevy_frugal_gi_tools::row_log::read_rows;

use super::CliError;
use super::arguments::{check_report, write_report};
use crate::control_log::cameras;
use crate::report::{control_log_facts, control_log_heading, control_log_report};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The log, as the plugin's `ControlLogPlugin` writes it
    #[arg(value_name = "LOG")]
    log: PathBuf,
    /// Folder for the report; default: the log's name with .report, beside the log
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let path = &arguments.log;
    let folder = arguments.output.clone().unwrap_or_else(|| path.with_extension("report"));
    check_report(Some(&folder))?;
    let text = std::fs::read_to_string(path).map_err(|error| {
        let remedy = "give a log that the plugin's ControlLogPlugin wrote";
        CliError::in_file(path, format!("cannot be read: {error}; {remedy}"))
    })?;
    let samples = read_rows(&text).map_err(|error| CliError::in_file(path, error))?;
    let logs = cameras(&samples);
    if logs.is_empty() {
        return Err(CliError::usage(format!(
            "{}: no samples: run the app with a controlled camera for longer than the log's interval",
            path.display()
        )));
    }
    for log in &logs {
        println!("{}", control_log_heading(log));
        for (name, value) in control_log_facts(log) {
            println!("  {name:<16} {value}");
        }
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_report(&folder, &control_log_report(&name, &logs).map_err(CliError::failed)?)
}

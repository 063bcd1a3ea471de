//! `frugal precompute`: a scene's frontier map.

mod arguments;
mod journal;
mod outcome;
mod search;

use std::path::PathBuf;

use super::arguments::{
    CaptureArguments, WorkerArguments, check_outputs, open_scene, write, write_report,
};
use super::{CliError, inspect};
use crate::report::{Report, map_section, search_section};

pub(super) use arguments::{SearchArguments, TrackArguments};
pub(super) use journal::{journal_header, journal_path, open_journal};
pub(super) use outcome::print_outcome;
pub(super) use search::{Searched, open_stage, prices, search};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Map to write; default: the scene's name with .pareto.ron, beside the scene
    #[arg(short, long, value_name = "MAP")]
    output: Option<PathBuf>,
    #[command(flatten)]
    capture: CaptureArguments,
    #[command(flatten)]
    search: SearchArguments,
    #[command(flatten)]
    workers: WorkerArguments,
    /// Folder for a report on the search and its map
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Resume an interrupted run
    #[arg(long)]
    resume: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    let output = arguments
        .output
        .clone()
        .unwrap_or_else(|| arguments.scene.with_file_name(format!("{name}.pareto.ron")));
    check_outputs([Some(&output)])?;
    arguments.search.check()?;
    let tracks = arguments.search.tracks.tracks(&scene, arguments.capture.fps)?;
    let workers = arguments.workers.count(arguments.capture.meter.as_deref())?;
    let mut stage = open_stage(&scene, &arguments.scene, &arguments.capture, workers)?;
    let journal = journal_path(&output, arguments.search.shard);
    let searched =
        search(&mut stage, &scene, &name, &tracks, &arguments.search, &journal, arguments.resume)?;
    write(&output, searched.map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);
    if let Some(folder) = &arguments.report {
        let mut report = Report::new(&format!("frugal precompute: {name}"));
        report.section(search_section(&searched.summary())?);
        report.section(map_section(&inspect::summary(&searched.map))?);
        write_report(folder, &report.render())?;
    }
    // The run is complete: its journal is not needed.
    let _ = std::fs::remove_file(&journal);
    Ok(())
}

//! `frugal precompute`: a scene's frontier map.

mod arguments;
mod outcome;
mod search;

use std::path::PathBuf;

use super::CliError;
use super::arguments::{
    CaptureArguments, WorkerArguments, check_outputs, check_report, write, write_report,
};
use super::input::{open_scene, stage_for};
use super::journal::{JournalArguments, journal_path, other_journals};
use crate::report::{Report, map_section, search_section};
use crate::stage::RemoteStage;

use arguments::SearchArguments;
use arguments::shard;
use outcome::print_outcome;
use search::{SearchPlan, search};

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
    /// Renders only every N-th job of each batch, beginning with the I-th: 0/4, 1/4, …; with --resume
    /// a shard reads the others' journals beside the map. Without a time limit, which each shard would
    /// keep apart
    #[arg(long, value_name = "I/N", value_parser = shard, conflicts_with = "time_limit")]
    shard: Option<(usize, usize)>,
    #[command(flatten)]
    workers: WorkerArguments,
    #[command(flatten)]
    journal: JournalArguments,
    /// Folder for a report on the search and its map
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    let output = arguments
        .output
        .clone()
        .unwrap_or_else(|| arguments.scene.with_file_name(format!("{name}.pareto.ron")));
    check_outputs([Some(&output)])?;
    check_report(arguments.report.as_ref())?;
    arguments.search.check()?;
    let tracks = arguments.search.tracks.tracks(&scene, arguments.capture.image.fps)?;
    let workers = arguments.workers.count(arguments.capture.meter.as_deref())?;
    let journal = journal_path(&output, arguments.shard);
    let plan = SearchPlan {
        scene: &scene,
        name: &name,
        tracks: &tracks,
        arguments,
        others: other_journals(&output, &journal),
        journal,
    };
    plan.check_journal()?;
    let request = stage_for(&scene, &arguments.capture)?;
    let mut stage = RemoteStage::open(&scene, request, workers)?;
    let searched = search(&mut stage, &plan)?;
    write(&output, searched.map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);
    if let Some(folder) = &arguments.report {
        let mut report = Report::new(&format!("frugal precompute: {name}"));
        report.section(search_section(&searched)?);
        report.section(map_section(&searched.map)?);
        write_report(folder, &report.render())?;
    }
    // The run is complete: its journal is not needed, but other shards read a shard's.
    if arguments.shard.is_none() {
        let _ = std::fs::remove_file(&plan.journal);
    }
    Ok(())
}

//! `frugal precompute`: a scene's frontier map.

mod arguments;
mod outcome;
mod search;

use super::CliError;
use super::arguments::{check_outputs, check_report, file_name, write, write_report};
use super::input::{open_scene, stage_for};
use super::journal::{journal_path, other_journals};
use crate::report::{Report, map_section, search_section};
use crate::stage::RemoteStage;

pub(super) use arguments::Arguments;
use outcome::print_outcome;
use search::{SearchPlan, search};

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    check_report(arguments.report.as_ref())?;
    arguments.search.check()?;
    let scene = open_scene(&arguments.scene)?;
    let output = arguments.output.clone().unwrap_or_else(|| {
        let beside = arguments.scene.scene.clone().unwrap_or_default();
        beside.with_file_name(format!("{}.pareto.ron", file_name(&scene.name)))
    });
    check_outputs([Some(&output)])?;
    let tracks = arguments.search.tracks.tracks(&scene, arguments.capture.image.fps)?;
    let workers = arguments.workers.count(arguments.capture.meter.as_deref())?;
    let journal = journal_path(&output, arguments.shard);
    let plan = SearchPlan {
        scene: &scene,
        tracks: &tracks,
        arguments,
        others: other_journals(&output, &journal),
        journal,
    };
    let request = stage_for(&scene, &arguments.capture);
    let mut stage = RemoteStage::open(&scene, request, workers)?;
    let searched = search(&mut stage, &plan)?;
    write(&output, searched.map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);
    if let Some(folder) = &arguments.report {
        let mut report = Report::new(&format!("frugal precompute: {}", scene.name));
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

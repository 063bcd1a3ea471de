//! `frugal sweep`: every combination at one camera.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::PathBuf;

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::KnobLevels;
use frugal_trace::scene::CameraPose;
use indicatif::ProgressBar;

use super::arguments::{
    CameraArguments, CaptureArguments, WorkerArguments, check_outputs, check_report, open_scene,
    write, write_report,
};
use super::precompute::open_stage;
use super::{CliError, progress};
use crate::cost::FrameLayout;
use crate::report::{SweepSummary, sweep_report};
use crate::scene::SceneDescription;
use crate::stage::RemoteStage;
use crate::table::{Batch, Measure as _, Measured, SweepFacts, SweepTable};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    capture: CaptureArguments,
    #[command(flatten)]
    workers: WorkerArguments,
    /// Table to write: `frugal search` runs searches in it
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Folder for a page with the cloud and its frontier
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

/// Frames metered for each combination: more than in a search, because a sweep is the reference for
/// searches.
const METERED_FRAMES: usize = 4;
/// Combinations that one process renders in a row. Lower values share work out more evenly at the end.
const COMBINATIONS: usize = 16;

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.camera.scene)?;
    let pose = arguments.camera.pose()?;
    check_outputs([arguments.csv.as_ref()])?;
    check_report(arguments.report.as_ref())?;
    let mut stage = open_stage(
        &scene,
        &arguments.camera.scene,
        &arguments.capture,
        arguments.workers.count(arguments.capture.meter.as_deref())?,
    )?;
    stage.warm()?;
    let space = stage.space().clone();
    let bar = progress::bar(space.combinations());
    let points = measure(&mut stage, &pose, &bar)?;
    bar.finish_and_clear();

    let frontier = Frontier::from_points(points.iter().copied());
    let worst = CostPoint::new(
        points.iter().map(|p| p.cost.power.0).fold(0.0, f64::max) * 1.01,
        points.iter().map(|p| p.cost.error).fold(0.0, f64::max) * 1.01,
    );
    println!("{} combinations, {} on the frontier", points.len(), frontier.points().len());
    println!(
        "hypervolume {:.6} W at reference ({:.4} W, {:.5})",
        frontier.hypervolume(worst),
        worst.power.0,
        worst.error
    );
    for point in frontier.points() {
        println!(
            "{:8.4} W  {:.5}  {}",
            point.cost.power.0,
            point.cost.error,
            space.describe(point.settings)
        );
    }
    if let Some(path) = &arguments.csv {
        let table = SweepTable {
            facts: facts(&scene, &name, &stage),
            space: space.clone(),
            points: points.clone(),
        };
        let mut text = Vec::new();
        table.write(&mut text).map_err(CliError::failed)?;
        write(path, &text)?;
    }
    if let Some(folder) = &arguments.report {
        let size = arguments.capture.image.size;
        let summary = SweepSummary {
            scene: &name,
            space: &space,
            points: &points,
            error: "1 − SSIM against the highest settings",
            meter: &stage.meter(),
            size: [size.x, size.y],
            fps: arguments.capture.image.fps,
            position: arguments.camera.position,
            look_at: arguments.camera.look_at,
        };
        write_report(folder, &sweep_report(&summary, &[])?)?;
    }
    Ok(())
}

/// All combinations, in their order.
fn measure(
    stage: &mut RemoteStage,
    pose: &CameraPose,
    bar: &ProgressBar,
) -> Result<Vec<FrontierPoint>, CliError> {
    let space = stage.space().clone();
    let all: Vec<_> = space.iter().collect();
    let batches: Vec<Batch> = all
        .chunks(COMBINATIONS)
        .map(|some| Batch { clip: vec![*pose; 1 + METERED_FRAMES], settings: some.to_vec() })
        .collect();
    let mut costs = HashMap::new();
    stage.measure_all(&batches, &mut |Measured { settings, cost, .. }| {
        costs.insert(settings, cost);
        bar.inc(1);
        if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    if progress::interrupted() {
        return Err(CliError::failed("interrupted: nothing was written"));
    }
    let point = |settings: KnobLevels| {
        costs.get(&settings).map(|cost| FrontierPoint { settings, cost: *cost })
    };
    Ok(all.into_iter().filter_map(point).collect())
}

fn facts(scene: &SceneDescription, name: &str, stage: &RemoteStage) -> SweepFacts {
    let layout = FrameLayout::of(scene, stage.size());
    SweepFacts {
        scene: Some(name.to_owned()),
        size: Some(layout.size),
        frames_per_second: Some(stage.frames_per_second()),
        maps: Some(layout.maps),
        point_lights: Some(layout.point_lights),
        has_sky: Some(layout.has_sky),
        meter: Some(stage.meter()),
    }
}

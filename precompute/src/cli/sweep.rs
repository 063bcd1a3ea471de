//! `frugal sweep`: every combination at one camera.

use std::collections::HashMap;
use std::path::PathBuf;

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};
use indicatif::ProgressBar;

use super::arguments::{CameraArguments, CaptureArguments, check_outputs, open_scene, write, write_report};
use super::precompute::open_stage;
use super::{CliError, progress};
use crate::report::{SweepSummary, sweep_csv, sweep_report};
use crate::scene::CameraPose;
use crate::search::{Evaluate, Search, SearchConfig};
use crate::stage::RemoteStage;
use crate::table::Measure as _;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    capture: CaptureArguments,
    /// Table to write
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Afterwards, searches the recorded table with this many seeds, and tells how much of the frontier each share of the evaluations finds
    #[arg(long, value_name = "SEEDS", default_value_t = 0)]
    search: u64,
    /// Folder for a page with the cloud and its frontier
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

/// Frames metered for each combination: a sweep is an oracle, so it reads longer than a search.
const METERED_FRAMES: usize = 4;

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.camera.scene)?;
    check_outputs([arguments.csv.as_ref()])?;
    let mut stage = open_stage(&scene, &arguments.camera.scene, &arguments.capture)?;
    stage.warm()?;
    let space = stage.space().clone();
    let pose = arguments.camera.pose();
    let bar = progress::bar(space.combinations());
    let points = measure(&mut stage, &pose, &bar)?;
    bar.finish_and_clear();

    let frontier = Frontier::from_points(points.iter().copied());
    let worst = CostPoint::new(
        points.iter().map(|p| p.cost.power.0).fold(0.0, f64::max) * 1.01,
        points.iter().map(|p| p.cost.error).fold(0.0, f64::max) * 1.01,
    );
    println!("{} combinations, {} on the frontier", points.len(), frontier.points().len());
    println!("hypervolume {:.6} W at reference ({:.4} W, {:.5})", frontier.hypervolume(worst), worst.power.0, worst.error);
    for point in frontier.points() {
        println!("{:8.4} W  {:.5}  {}", point.cost.power.0, point.cost.error, space.describe(point.settings));
    }
    if arguments.search > 0 {
        compare_search(&space, &points, worst, arguments.search)?;
    }
    if let Some(path) = &arguments.csv {
        let mut table = Vec::new();
        sweep_csv(&space, &points, &mut table).map_err(CliError::failed)?;
        write(path, &table)?;
    }
    if let Some(folder) = &arguments.report {
        let size = arguments.capture.size;
        let summary = SweepSummary {
            scene: &name,
            space: &space,
            points: &points,
            error: "1 − SSIM against the highest settings",
            meter: &stage.meter(),
            size: [size.x, size.y],
            fps: arguments.capture.fps,
            position: arguments.camera.position,
            look_at: arguments.camera.look_at,
        };
        write_report(folder, &sweep_report(&summary, &[])?)?;
    }
    Ok(())
}

fn measure(stage: &mut RemoteStage, pose: &CameraPose, bar: &ProgressBar) -> Result<Vec<FrontierPoint>, CliError> {
    let space = stage.space().clone();
    let mut points = Vec::new();
    for settings in space.iter() {
        if progress::interrupted() {
            return Err(CliError::failed("interrupted: nothing was written"));
        }
        points.push(FrontierPoint { settings, cost: stage.measure(&[*pose; 1 + METERED_FRAMES], settings)? });
        bar.inc(1);
    }
    Ok(points)
}

/// A sweep's table, as something to search.
struct Table(HashMap<RenderSettings, CostPoint>);

impl Evaluate for Table {
    type Error = CliError;

    fn evaluate(&mut self, settings: RenderSettings) -> Result<CostPoint, CliError> {
        self.0.get(&settings).copied().ok_or_else(|| CliError::failed("the search asked for settings that were not swept"))
    }
}

/// Median over the seeds of the hypervolume that the genetic search finds in the table, as a share of the whole table's.
fn compare_search(space: &KnobSpace, points: &[FrontierPoint], worst: CostPoint, seeds: u64) -> Result<(), CliError> {
    let whole = Frontier::from_points(points.iter().copied()).hypervolume(worst);
    println!(
        "NSGA-II in this table, median of {seeds} seeds: evaluations, share of the combinations, share of the hypervolume (worst seed)"
    );
    for limit in [points.len() / 40, points.len() / 20, points.len() / 10, points.len() / 5, points.len() / 2] {
        let mut shares = Vec::new();
        let mut used = 0;
        for seed in 0..seeds {
            let mut table = Table(points.iter().map(|point| (point.settings, point.cost)).collect());
            let config = SearchConfig { seed, max_evaluations: Some(limit.max(4)), ..Default::default() };
            let found = Search::new(space, config).run(&mut table, &[], &mut |_| true)?;
            used = used.max(found.evaluations);
            shares.push(found.frontier.hypervolume(worst) / whole);
        }
        shares.sort_by(f64::total_cmp);
        let (median, least) = (shares[shares.len() / 2], shares[0]);
        println!("{used:6}  {:5.1} %  {:6.2} %  ({:.2} %)", 100.0 * used as f64 / points.len() as f64, 100.0 * median, 100.0 * least);
    }
    Ok(())
}

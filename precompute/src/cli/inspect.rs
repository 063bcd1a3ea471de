//! `frugal inspect`: what a map holds.

use std::path::{Path, PathBuf};

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::units::Watts;

use super::CliError;
use super::arguments::write_report;
use crate::report::{MapSummary, Survey, map_report};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The map
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Folder for a page with pictures
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

pub(super) fn summary(map: &FrontierMap) -> MapSummary<'_> {
    MapSummary {
        scene: &map.scene.name,
        space: &map.knobs,
        octree: &map.octree,
        bounds_min: Vec3::from_array(map.bounds.min),
        bounds_max: Vec3::from_array(map.bounds.max),
        meter: &map.meter,
        size: map.capture.size,
        fps: map.capture.frames_per_second,
        power_threshold: Watts(map.thresholds.power_w),
        error_threshold: map.thresholds.error,
    }
}

/// A map and its text.
pub(super) fn read(path: &Path) -> Result<(FrontierMap, String), CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| CliError::usage(format!("{}: cannot be read: {error}", path.display())))?;
    let map = FrontierMap::from_ron(&text).map_err(|error| CliError::usage(format!("{}: {error}", path.display())))?;
    Ok((map, text))
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (map, text) = read(&arguments.map)?;
    let survey = Survey::new(&map.octree);
    let points: usize = map.octree.frontiers.iter().map(|frontier| frontier.points().len()).sum();
    let [width, height] = map.capture.size;
    println!("scene      {} ({})", map.scene.name, map.scene.fingerprint);
    println!("capture    {width}x{height} at {} frames per second", map.capture.frames_per_second);
    println!("power      {:?}, {}: {}", map.meter.provenance, map.meter.name, map.meter.description);
    println!("knobs      {}, {} combinations", map.knobs.len(), map.knobs.combinations());
    println!("octree     {} nodes, {} corners, {} levels", map.octree.nodes.len(), map.octree.corners.len(), map.octree.levels);
    println!(
        "frontiers  {}, {points} points; {} of {} views see nothing",
        map.octree.frontiers.len(),
        survey.empty_views,
        survey.known_views + survey.empty_views
    );
    println!("thresholds {:.4} W, {}", map.thresholds.power_w, map.thresholds.error);
    println!("file       {} bytes", text.len());
    if let Some(folder) = &arguments.report {
        write_report(folder, &map_report(&summary(&map), &[("file".to_owned(), arguments.map.display().to_string())])?)?;
    }
    Ok(())
}

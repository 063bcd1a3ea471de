//! `frugal reprice`: a map's power on another device, at another size or frame rate.

use std::path::PathBuf;

use frugal_core::frontier::FrontierMap;
use frugal_search::cost::{DeviceModel, NewConditions, reprice};
use glam::UVec2;

use super::CliError;
use super::arguments::{check_outputs, frame_rate, size, write};
use super::input::read_map;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The map
    #[arg(value_name = "MAP")]
    map: PathBuf,
    /// Prices of the device, as frugal calibrate writes them; default: the map's own
    #[arg(long, value_name = "FILE")]
    prices: Option<PathBuf>,
    /// Size of the images
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<UVec2>,
    /// Frame rate
    #[arg(long, value_name = "N", value_parser = frame_rate, allow_hyphen_values = true)]
    fps: Option<f64>,
    /// Map to write; default: over the old one
    #[arg(short, long, value_name = "MAP")]
    output: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (map, _) = read_map(&arguments.map)?;
    let output = arguments.output.as_ref().unwrap_or(&arguments.map);
    check_outputs([Some(output)])?;
    let device = arguments.prices.as_ref().map(|path| {
        let named = |error: &dyn std::fmt::Display| {
            CliError::usage(format!(
                "{}: {error}; give a file that frugal calibrate wrote",
                path.display()
            ))
        };
        let text = std::fs::read_to_string(path).map_err(|error| named(&error))?;
        ron::from_str::<DeviceModel>(&text).map_err(|error| named(&error))
    });
    let to = NewConditions {
        device: device.transpose()?,
        size: arguments.size.map(|size| size.to_array()),
        frames_per_second: arguments.fps,
    };
    let repriced = reprice(&map, &to).map_err(|error| CliError::in_file(&arguments.map, error))?;
    repriced.validate().map_err(|error| {
        CliError::usage(format!("{}: repriced, {error}", arguments.map.display()))
    })?;
    write(output, repriced.to_ron().map_err(CliError::failed)?.as_bytes())?;
    let range = |map: &FrontierMap| {
        let points = map.shared.points();
        [points.first(), points.last()].map(|point| point.map_or(0.0, |point| point.cost.power.0))
    };
    let ([least, most], [least_now, most_now]) = (range(&map), range(&repriced));
    println!(
        "the shared frontier went from {least:.2} to {most:.2} W; now {least_now:.2} to {most_now:.2} W"
    );
    Ok(())
}

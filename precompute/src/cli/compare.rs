//! `frugal compare`: difference between the radiance of two images.

use std::path::{Path, PathBuf};

use frugal_trace::metrics::{Difference, Radiance};

use super::CliError;
use super::arguments::{check_outputs, json, write};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The image: linear radiance, as `render --hdr` writes it
    #[arg(value_name = "PICTURE")]
    picture: PathBuf,
    /// The reference: linear radiance, as `reference --hdr` writes it
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    /// Exposure value of the tone curve before SSIM; default: the one at which the reference's
    /// median luminance is middle grey
    #[arg(long, value_name = "EV", allow_hyphen_values = true)]
    exposure_ev100: Option<f32>,
    /// Result for programs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// The result for programs.
#[derive(serde::Serialize)]
struct Comparison<'a> {
    picture: &'a Path,
    reference: &'a Path,
    size: [u32; 2],
    #[serde(flatten)]
    difference: Difference,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    if let Some(exposure) =
        arguments.exposure_ev100.filter(|exposure| !(-100.0..=100.0).contains(exposure))
    {
        return Err(CliError::usage(format!(
            "--exposure-ev100 {exposure}: must be a number from -100 to 100"
        )));
    }
    check_outputs([arguments.json.as_ref()])?;
    let [picture, reference] =
        [&arguments.picture, &arguments.reference].map(|path| Radiance::read_exr(path));
    let (picture, reference) =
        (picture.map_err(CliError::usage)?, reference.map_err(CliError::usage)?);
    let difference =
        Difference::new(&picture, &reference, arguments.exposure_ev100).map_err(|error| {
            CliError::usage(format!(
                "{} against {}: {error}",
                arguments.picture.display(),
                arguments.reference.display()
            ))
        })?;
    let chosen = if arguments.exposure_ev100.is_none() {
        " (the reference's median is middle grey)"
    } else {
        ""
    };
    println!("mean ratio                 {:.4}", difference.mean_ratio);
    println!("relative L1                {:.4}", difference.relative_l1);
    println!("relative L1 of 4x4 means   {:.4}", difference.relative_l1_boxes);
    println!(
        "1 - SSIM                   {:.4} at EV100 {:.2}{chosen}",
        difference.one_minus_ssim, difference.exposure_ev100
    );
    match &arguments.json {
        Some(path) => {
            let size = [reference.width, reference.height];
            let comparison = Comparison {
                picture: &arguments.picture,
                reference: &arguments.reference,
                size,
                difference,
            };
            write(path, &json(&comparison)?)
        }
        None => Ok(()),
    }
}

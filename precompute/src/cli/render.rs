//! `frugal render`: one image.

use super::CliError;
use super::arguments::{CameraArguments, ImageArguments, PictureArguments, write};
use super::input::open_scene;
use crate::stage::{Component, Output, Stage, StageOptions};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    image: ImageArguments,
    /// `max`, `min`, `default` (of the plugin's component), or knob=level pairs; the other knobs are at
    /// their best
    #[arg(long, value_name = "SETTINGS", default_value = "max")]
    settings: String,
    /// Component of the light
    #[arg(long, value_enum, default_value_t = Component::Full)]
    component: Component,
    #[command(flatten)]
    picture: PictureArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.camera.scene)?;
    let png = arguments.picture.png(&name)?;
    let pose = arguments.camera.pose()?;
    let take = |output: Output| -> Result<Stage, CliError> {
        let options =
            StageOptions { output, component: arguments.component, ..arguments.image.options() };
        let mut stage = Stage::open(&scene, options)?;
        stage.place(pose.position, pose.rotation);
        stage.apply_text(&arguments.settings)?;
        stage.get_ready()?;
        Ok(stage)
    };
    if let Some(path) = png {
        let picture = take(Output::Display)?.picture()?;
        write(&path, &picture.to_png().map_err(CliError::failed)?)?;
    }
    if let Some(path) = &arguments.picture.hdr {
        let radiance = take(Output::Radiance)?.radiance()?;
        println!("mean radiance {:.3} nits", radiance.mean());
        write(path, &radiance.to_exr().map_err(CliError::failed)?)?;
    }
    Ok(())
}

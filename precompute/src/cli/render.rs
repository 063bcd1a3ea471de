//! `frugal render`: one image.

use super::CliError;
use super::arguments::{
    COMPONENTS, CameraArguments, ImageArguments, PictureArguments, one_of, write,
};
use super::input::open_scene;
use crate::stage::{Component, Output, Shot, StageOptions};

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
    #[arg(long, value_name = "COMPONENT", default_value = "full", value_parser = one_of(COMPONENTS))]
    component: Component,
    #[command(flatten)]
    picture: PictureArguments,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    // Before an app is built.
    let pose = arguments.camera.pose()?;
    arguments.picture.check()?;
    let scene = open_scene(&arguments.camera.scene)?;
    let png = arguments.picture.png(&scene.name)?;
    let shoot = |output: Output| -> Result<Shot, CliError> {
        let component = arguments.component;
        let options = StageOptions { output, component, ..arguments.image.options() };
        Ok(scene.process(options).shoot(&pose, &arguments.settings)?)
    };
    if let Some(path) = png
        && let Shot::Picture(picture) = shoot(Output::Display)?
    {
        write(&path, &picture.to_png().map_err(CliError::failed)?)?;
    }
    if let Some(path) = &arguments.picture.hdr
        && let Shot::Radiance(radiance) = shoot(Output::Radiance)?
    {
        println!("mean radiance {:.3} nits", radiance.mean());
        write(path, &radiance.to_exr().map_err(CliError::failed)?)?;
    }
    Ok(())
}

//! `frugal render`: one picture.

use std::path::PathBuf;

use super::CliError;
use super::arguments::{self, CameraArguments, CaptureArguments, check_outputs, open_scene, write};
use crate::stage::{Component, Output, Stage, StageOptions};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    #[command(flatten)]
    camera: CameraArguments,
    #[command(flatten)]
    capture: CaptureArguments,
    /// `max`, `min`, or knob=level pairs, which lower the best settings
    #[arg(long, value_name = "SETTINGS", default_value = "max")]
    settings: String,
    /// Which light
    #[arg(long, value_enum, default_value_t = Component::Full)]
    component: Component,
    /// Picture to write, tone-mapped
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    /// Linear radiance to write, in nits before exposure
    #[arg(long, value_name = "EXR")]
    hdr: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    let png = match (&arguments.output, &arguments.hdr) {
        (None, None) => Some(PathBuf::from(format!("{name}.png"))),
        (png, _) => png.clone(),
    };
    check_outputs([png.as_ref(), arguments.hdr.as_ref()])?;
    let take = |output: Output| -> Result<Stage, CliError> {
        let options = StageOptions { output, component: arguments.component, ..arguments.capture.options() };
        let mut stage = Stage::open(&scene, options)?;
        let settings = stage.space().parse(&arguments.settings).map_err(CliError::usage)?;
        let pose = arguments.camera.pose();
        stage.place(pose.position, pose.rotation);
        stage.apply(settings);
        stage.get_ready()?;
        Ok(stage)
    };
    if let Some(path) = png {
        let picture = take(Output::Display)?.picture()?;
        write(&path, &picture.to_png().map_err(CliError::failed)?)?;
    }
    if let Some(path) = &arguments.hdr {
        let radiance = take(Output::Radiance)?.radiance()?;
        println!("mean radiance {:.3} nits", radiance.mean());
        arguments::write(path, &radiance.to_exr().map_err(CliError::failed)?)?;
    }
    Ok(())
}

//! Arguments that several commands share.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy_frugal_gi::stage::NO_METER;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use frugal_search::files;
use frugal_trace::scene::CameraPose;
use glam::{UVec2, Vec3};

use super::CliError;
use crate::stage::{Component, Program, StageOptions};
use crate::work_meter::is_work_meter;

/// Conditions of images: size, frame rate and knobs.
#[derive(Args, Debug, Clone)]
pub(super) struct ImageArguments {
    /// Size of the images in pixels; use the app's own size for watts and errors of the app
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = size)]
    pub size: UVec2,
    /// Frame rate, to which watts refer
    #[arg(long, value_name = "N", default_value = "30", value_parser = frame_rate, allow_hyphen_values = true)]
    pub fps: f64,
    /// Knobs to use, by name; default: all that affect the scene
    #[arg(long, value_name = "K1,K2,…", value_delimiter = ',')]
    pub knobs: Option<Vec<String>>,
}

/// Values by their names, each with help.
pub(super) type Choices<T> = &'static [(&'static str, T, &'static str)];

/// Components of the light.
pub(super) const COMPONENTS: Choices<Component> = &[
    ("full", Component::Full, "All light"),
    (
        "direct",
        Component::Direct,
        "The renderer's light without global illumination; in a path-traced image, light that at most one surface scattered",
    ),
    (
        "indirect",
        Component::Indirect,
        "Indirect light of punctual lights, with Lambertian surfaces; in a path-traced image, light that two or more surfaces scattered",
    ),
    (
        "global",
        Component::Global,
        "The light that global illumination adds: indirect light, and light of emissive surfaces and of the sky on other surfaces",
    ),
];

/// Reads one of `choices` by its name.
pub(super) fn one_of<T: Clone + Send + Sync>(
    choices: Choices<T>,
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|(name, _, help)| PossibleValue::new(*name).help(*help));
    PossibleValuesParser::new(names).map(|name| {
        let found = choices.iter().find(|(known, ..)| *known == name);
        found.unwrap_or(&choices[0]).1.clone()
    })
}

/// Capture conditions: those of the images, and the meter.
#[derive(Args, Debug, Clone)]
pub(super) struct CaptureArguments {
    #[command(flatten)]
    pub image: ImageArguments,
    /// Power meter, as `frugal meters` names it; default: the one that suits the adapter. `work`
    /// counts each frame's work at fixed prices and is the same in every run; `work=FILE` takes the
    /// prices from `frugal calibrate`
    #[arg(long, value_name = "NAME")]
    pub meter: Option<String>,
}

impl ImageArguments {
    /// For a stage whose power nobody reads.
    pub(super) fn options(&self) -> StageOptions {
        StageOptions {
            size: self.size,
            frames_per_second: self.fps,
            knobs: self.knobs.clone(),
            meter: Some(NO_METER.to_owned()),
            ..Default::default()
        }
    }
}

/// Number of processes that render.
#[derive(Args, Debug, Clone)]
pub(super) struct WorkerArguments {
    /// Processes that render side by side. Higher values keep more of a processor or GPU busy, and take
    /// as many times the memory. More than 1 needs `--meter work`
    #[arg(long, value_name = "N", default_value = "1")]
    workers: NonZeroUsize,
}

impl WorkerArguments {
    /// The number, for a meter of this name.
    ///
    /// # Errors
    /// Where several processes would disturb what the meter reads.
    pub(super) fn count(&self, meter: Option<&str>) -> Result<NonZeroUsize, CliError> {
        let reads_machine = meter.is_none_or(|name| is_work_meter(name).is_none());
        if self.workers.get() > 1 && reads_machine {
            return Err(CliError::usage(format!(
                "--workers {}: meters read the whole machine, so that processes would disturb each other's readings: add `--meter work`, or `--meter work=FILE` with prices from `frugal calibrate`",
                self.workers
            )));
        }
        Ok(self.workers)
    }
}

/// What is rendered: a scene file, or an app.
#[derive(Args, Debug, Clone)]
pub(super) struct SceneArguments {
    /// The scene
    #[arg(value_name = "SCENE", required_unless_present = "app")]
    pub scene: Option<PathBuf>,
    /// Command that starts an app, in place of a scene: `cargo run --release --features stage`. The app
    /// has the plugin's `StagePlugin`
    #[arg(long, value_name = "COMMAND", conflicts_with = "scene")]
    app: Option<String>,
    /// Level of the app; default: the one that it shows without `frugal`
    #[arg(long, value_name = "NAME", requires = "app")]
    level: Option<String>,
    /// Longest wait for the app: until it is built and runs, for its level, and for each answer
    #[arg(long, value_name = "TIME", default_value = "30m", value_parser = duration)]
    patience: Duration,
}

impl SceneArguments {
    /// What renders it.
    pub(super) fn program(&self) -> Program {
        match &self.app {
            None => Program::File(self.scene.clone().unwrap_or_default()),
            Some(command) => Program::App {
                command: command.clone(),
                level: self.level.clone(),
                patience: self.patience,
            },
        }
    }
}

/// Scene and camera of one image.
#[derive(Args, Debug, Clone)]
pub(super) struct CameraArguments {
    #[command(flatten)]
    pub scene: SceneArguments,
    /// World position, metres
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub position: Vec3,
    /// Point that the camera looks at, metres
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub look_at: Vec3,
}

impl CameraArguments {
    /// # Errors
    /// Where the camera looks at itself: it has no direction.
    pub(super) fn pose(&self) -> Result<CameraPose, CliError> {
        if self.position == self.look_at {
            return Err(CliError::usage(
                "--position and --look-at are the same point: the camera has no direction",
            ));
        }
        Ok(CameraPose::looking_at(self.position, self.look_at))
    }
}

/// Output files of one image.
#[derive(Args, Debug, Clone)]
pub(super) struct PictureArguments {
    /// Image to write, tone-mapped at the scene's exposure
    #[arg(short, long, value_name = "PNG")]
    output: Option<PathBuf>,
    /// Linear radiance to write, in nits before exposure
    #[arg(long, value_name = "EXR")]
    pub hdr: Option<PathBuf>,
}

impl PictureArguments {
    /// Fails if a file that is given cannot be written.
    pub(super) fn check(&self) -> Result<(), CliError> {
        check_outputs([self.output.as_ref(), self.hdr.as_ref()])
    }

    /// The PNG to write; by default, named after the scene if no file is given. Fails if it cannot
    /// be written.
    pub(super) fn png(&self, scene_name: &str) -> Result<Option<PathBuf>, CliError> {
        let png = match (&self.output, &self.hdr) {
            (None, None) => Some(PathBuf::from(format!("{}.png", file_name(scene_name)))),
            (png, _) => png.clone(),
        };
        check_outputs([png.as_ref()])?;
        Ok(png)
    }
}

/// A scene's name as that of a file: `app/level` is in no folder.
pub(super) fn file_name(scene_name: &str) -> String {
    scene_name.replace(['/', '\\'], "-")
}

/// `320x180`.
pub(super) fn size(text: &str) -> Result<UVec2, String> {
    let parse = |number: &str| number.trim().parse::<u32>().ok().filter(|n| (1..=8192).contains(n));
    let (width, height) =
        text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT, as in 320x180")?;
    match (parse(width), parse(height)) {
        (Some(width), Some(height)) => Ok(UVec2::new(width, height)),
        _ => Err("width and height must be whole numbers from 1 to 8192".to_owned()),
    }
}

/// Frames per second.
pub(super) fn frame_rate(text: &str) -> Result<f64, String> {
    let rate = text.trim().parse().ok().filter(|rate: &f64| *rate > 0.0 && *rate <= 1000.0);
    rate.ok_or_else(|| "a frame rate is a number above 0 and at most 1000".to_owned())
}

/// `1.5,2,-3`.
pub(super) fn vector(text: &str) -> Result<Vec3, String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if Vec3::new(x, y, z).is_finite() => Ok(Vec3::new(x, y, z)),
        _ => Err("expected three finite numbers, as in 1.5,2,-3".to_owned()),
    }
}

/// `90s`, `10m`, `1.5h`, or seconds.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let mut units = [('s', 1.0), ('m', 60.0), ('h', 3600.0)].into_iter();
    let of_unit = |(unit, seconds): (char, f64)| Some((text.trim().strip_suffix(unit)?, seconds));
    let (number, seconds) = units.find_map(of_unit).unwrap_or((text.trim(), 1.0));
    let number: f64 = number.parse().map_err(|_| "expected a time, as in 90s, 10m or 1h")?;
    let length = Duration::try_from_secs_f64(number * seconds)
        .map_err(|_| "a time limit must be above 0 and finite")?;
    if length.is_zero() { Err("a time limit must be above 0".to_owned()) } else { Ok(length) }
}

/// Fails if an output cannot be written, before any long work.
pub(super) fn check_outputs<'p>(
    paths: impl IntoIterator<Item = Option<&'p PathBuf>>,
) -> Result<(), CliError> {
    let check = |path: &PathBuf| files::check_writable(path).map_err(CliError::usage);
    paths.into_iter().flatten().try_for_each(check)
}

/// The same for the folder of a report, which is made if missing.
pub(super) fn check_report(folder: Option<&PathBuf>) -> Result<(), CliError> {
    let there = |folder: &PathBuf| {
        folder.ancestors().find(|parent| parent.exists()).unwrap_or(Path::new("")).join(REPORT)
    };
    check_outputs([folder.map(there).as_ref()])
}

/// The file of a report in its folder.
const REPORT: &str = "report.html";

/// Writes a file atomically, and prints its path.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    files::write_atomically(path, |file| file.write_all(bytes)).map_err(CliError::failed)?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

/// The same for a report in a folder, which is created if missing.
pub(super) fn write_report(folder: &Path, html: &str) -> Result<(), CliError> {
    std::fs::create_dir_all(folder).map_err(|error| {
        CliError::failed(format!("cannot make the folder {}: {error}", folder.display()))
    })?;
    write(&folder.join(REPORT), html.as_bytes())
}

/// Indented JSON.
pub(super) fn json(value: &impl serde::Serialize) -> Result<Vec<u8>, CliError> {
    let mut text = serde_json::to_vec_pretty(value).map_err(CliError::failed)?;
    text.push(b'\n');
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_sizes_read_as_people_write_them() {
        assert_eq!(duration("90s"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("2h"), Ok(Duration::from_secs(7200)));
        assert_eq!(duration("45"), Ok(Duration::from_secs(45)));
        assert!(
            ["", "m", "-1s", "0", "nan", "inf", "1e300h", "ten"]
                .into_iter()
                .all(|text| duration(text).is_err())
        );
        assert_eq!(size("320x180"), Ok(UVec2::new(320, 180)));
        assert!(
            ["", "320", "0x1", "1x9000", "-1x4", "axb"].into_iter().all(|text| size(text).is_err())
        );
        assert_eq!(vector("1, -2.5,3"), Ok(Vec3::new(1.0, -2.5, 3.0)));
        assert!(
            ["", "1,2", "1,2,3,4", "1,2,nan", "a,b,c"]
                .into_iter()
                .all(|text| vector(text).is_err())
        );
    }
}

//! What commands read: scenes, maps, paths; and the stages that they open.

use std::path::Path;

use frugal_core::frontier::{FrontierMap, SceneIdentity};
use frugal_core::knobs::did_you_mean;

use frugal_search::evaluate::PathPlan;

use super::CliError;
use super::arguments::CaptureArguments;
use crate::evaluate::plan_along;
use crate::scene::{self, CameraPath, LoadedScene, SceneDescription};
use crate::stage::{self, StageOptions};

/// Loads a scene; returns it with its name.
pub(super) fn open_scene(path: &Path) -> Result<(LoadedScene, String), CliError> {
    let scene = scene::load(path)?;
    let file = path
        .file_name()
        .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
    let name = file.strip_suffix(".scene.ron").map_or_else(|| file.clone(), str::to_owned);
    Ok((scene, name))
}

/// Reads a map; returns it with its text.
pub(super) fn read_map(path: &Path) -> Result<(FrontierMap, String), CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        CliError::usage(format!(
            "{}: cannot be read: {error}; give a map written by frugal precompute",
            path.display()
        ))
    })?;
    let map = FrontierMap::from_ron(&text).map_err(|error| CliError::in_file(path, error))?;
    Ok((map, text))
}

/// Reads a map and checks that it belongs to the scene.
pub(super) fn read_map_of(
    scene: &SceneDescription,
    name: &str,
    path: &Path,
) -> Result<FrontierMap, CliError> {
    let (map, _) = read_map(path)?;
    let identity = SceneIdentity { name: name.to_owned(), fingerprint: scene.fingerprint()? };
    map.matches_scene(&identity).map_err(|error| CliError::in_file(path, error))?;
    Ok(map)
}

/// The scene's path called `name`.
pub(super) fn path_called<'s>(
    scene: &'s SceneDescription,
    name: &str,
) -> Result<&'s CameraPath, CliError> {
    scene.paths.get(name).ok_or_else(|| {
        let known: Vec<_> = scene.paths.keys().map(String::as_str).collect();
        let known = if known.is_empty() {
            "it has none".to_owned()
        } else {
            let guess = did_you_mean(name, known.iter().copied());
            format!("{guess}it has {}; name one of them with --path", known.join(", "))
        };
        CliError::usage(format!("{}: no path `{name}`: {known}", scene.source.display()))
    })
}

/// The scene's path called `name`, at `fps` frames per second.
pub(super) fn plan_path(
    scene: &SceneDescription,
    name: &str,
    fps: f64,
) -> Result<PathPlan, CliError> {
    let path = path_called(scene, name)?;
    plan_along(name, path, fps).map_err(CliError::usage)
}

/// Names of the requested knobs, or of those that affect the scene.
pub(super) fn knobs(
    scene: &LoadedScene,
    capture: &CaptureArguments,
) -> Result<Vec<String>, CliError> {
    Ok(match &capture.image.knobs {
        Some(names) => names.clone(),
        None => stage::useful_knobs(scene)?,
    })
}

/// Options of a stage of `scene` under the conditions of the arguments.
pub(super) fn stage_for(
    scene: &LoadedScene,
    capture: &CaptureArguments,
) -> Result<StageOptions, CliError> {
    let (knobs, meter) = (Some(knobs(scene, capture)?), capture.meter.clone());
    Ok(StageOptions { knobs, meter, ..capture.image.options() })
}

/// The same under the conditions of the map at `map_path`; `meter`: another than the map's.
pub(super) fn stage_for_map(
    map: &FrontierMap,
    map_path: &Path,
    meter: Option<String>,
) -> Result<StageOptions, CliError> {
    let here = stage::every_knob()?;
    for knob in map.knobs.knobs() {
        let (path, name) = (map_path.display(), &knob.name);
        match here.index_of(name).map(|index| &here.knobs()[index]) {
            None => {
                let guess = did_you_mean(name, here.knobs().iter().map(|knob| knob.name.as_str()));
                return Err(CliError::usage(format!(
                    "{path}: its knob `{name}` does not exist here: {guess}run frugal precompute again"
                )));
            }
            Some(other) if other.levels != knob.levels => {
                return Err(CliError::usage(format!(
                    "{path}: its knob `{name}` has other levels here: run frugal precompute again"
                )));
            }
            Some(_) => {}
        }
    }
    Ok(StageOptions {
        size: map.capture.size.into(),
        frames_per_second: map.capture.frames_per_second,
        knobs: Some(map.knobs.knobs().iter().map(|knob| knob.name.clone()).collect()),
        meter: meter.or_else(|| Some(map.meter.name.clone())),
        ..Default::default()
    })
}

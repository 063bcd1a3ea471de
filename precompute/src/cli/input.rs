//! What commands read: scenes, maps, paths; and the stages that they open.

use std::path::Path;

use frugal_core::frontier::FrontierMap;
use frugal_core::knobs::did_you_mean;
use frugal_core::power::MeterInfo;

use frugal_search::evaluate::PathPlan;

use super::CliError;
use super::arguments::{CaptureArguments, SceneArguments};
use crate::device;
use crate::evaluate::plan_along;
use crate::scene::CameraPath;
use crate::stage::{Program, StageOptions, StagedScene};
use crate::subject::recorded_tracks;
use crate::work_meter;

/// What the arguments name: a scene file, or an app's level, whose program is started.
pub(super) fn open_scene(arguments: &SceneArguments) -> Result<StagedScene, CliError> {
    match arguments.program() {
        Program::File(path) => Ok(StagedScene::of_file(&path)?),
        program => Ok(StagedScene::of_app(program)?),
    }
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

/// The scene's path called `name`. `recordings`: the option for those of an app, which has no paths.
pub(super) fn path_called<'s>(
    scene: &'s StagedScene,
    name: &str,
    recordings: &str,
) -> Result<&'s CameraPath, CliError> {
    scene.paths.get(name).ok_or_else(|| {
        let known: Vec<_> = scene.paths.keys().map(String::as_str).collect();
        let known = if known.is_empty() {
            format!("it has none; give a recording to {recordings}")
        } else {
            let guess = did_you_mean(name, known.iter().copied());
            format!("{guess}it has {}; name one of them with --path", known.join(", "))
        };
        CliError::usage(format!("{}: no path `{name}`: {known}", scene.label))
    })
}

/// The scene's path called `name`, or the longest track of the recording of that name, at `fps` frames
/// per second.
pub(super) fn plan_path(scene: &StagedScene, name: &str, fps: f64) -> Result<PathPlan, CliError> {
    let file = Path::new(name);
    if scene.paths.contains_key(name) || !file.is_file() {
        return plan_along(name, path_called(scene, name, "--path")?, fps).map_err(CliError::usage);
    }
    let tracks = recorded_tracks(file, fps).map_err(CliError::usage)?;
    let track = tracks.into_iter().max_by_key(Vec::len).unwrap_or_default();
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    PathPlan::new(&stem, fps, track.iter().map(|sample| sample.pose)).map_err(CliError::usage)
}

/// Options of a stage of `scene` under the conditions of the arguments, by default with the knobs that
/// affect it.
pub(super) fn stage_for(scene: &StagedScene, capture: &CaptureArguments) -> StageOptions {
    let knobs = capture.image.knobs.clone().unwrap_or_else(|| scene.useful_knobs());
    let meter = capture.meter.clone();
    StageOptions { knobs: Some(knobs), meter, ..capture.image.options() }
}

/// The same under the conditions of the map at `map_path`; `meter`: another than the map's.
pub(super) fn stage_for_map(
    scene: &StagedScene,
    map: &FrontierMap,
    map_path: &Path,
    meter: Option<String>,
) -> Result<StageOptions, CliError> {
    let here = &scene.knobs;
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
        meter: meter.or_else(|| Some(work_meter::of_map(&map.meter.name, map_path))),
        ..Default::default()
    })
}

/// Fails where the meter `here`, opened by the name in the map, has other watts than the map's: the name
/// lacks the parameter of the search, and the machine.
pub(super) fn check_meter(
    map: &FrontierMap,
    map_path: &Path,
    here: &MeterInfo,
) -> Result<(), CliError> {
    if device::is_same(&map.meter, here) {
        return Ok(());
    }
    let [of_map, here] =
        [&map.meter, here].map(|meter| format!("{}: {}", meter.name, meter.description));
    Err(CliError::usage(format!(
        "{}: its watts are not those of the meter here, `{of_map}` and `{here}`: add --meter NAME, with the parameter that the search had, such as --meter cpu-time=5",
        map_path.display()
    )))
}

#[cfg(test)]
mod tests {
    use frugal_core::power::Provenance;

    use super::*;

    #[test]
    fn a_meter_of_another_scale_is_refused_and_counted_work_is_the_same_everywhere() {
        let meter = |name: &str, description: &str| MeterInfo {
            name: name.to_owned(),
            provenance: Provenance::Modelled,
            description: description.to_owned(),
        };
        let check = |of_map: MeterInfo, here: MeterInfo| {
            let map = FrontierMap { meter: of_map, ..frugal_core::testing::map(0) };
            check_meter(&map, Path::new("a.pareto.ron"), &here)
        };
        let cpu = |watts: u8, machine: &str| {
            meter("cpu-time", &format!("CPU time × {watts} W per busy core; on {machine}"))
        };
        assert!(check(cpu(5, "Intel N100"), cpu(5, "Intel N100")).is_ok());
        for here in [cpu(3, "Intel N100"), cpu(5, "AMD Ryzen 5")] {
            let error = check(cpu(5, "Intel N100"), here.clone()).expect_err("other watts");
            assert_eq!(error.status, 2);
            let other = here.description.as_str();
            for words in ["a.pareto.ron: ", "× 5 W", other, "--meter cpu-time=5"] {
                assert!(error.message.contains(words), "`{words}` in: {error}");
            }
        }
        let work = |name: &str| device::on_this_machine(meter(name, "work at the prices"), None);
        assert!(check(work("work=a.prices.ron"), work("work")).is_ok());
    }
}

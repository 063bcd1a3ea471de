//! `frugal evaluate`: a camera path under a budget, beside the fixed presets.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use bevy_frugal_gi::control::{Budget, ControlSettings, SettingsFilter, select};
use bevy_frugal_gi::frontier::{CameraView, FrontierMap, FrontierStore, SceneIdentity};

use super::arguments::{check_outputs, json, open_scene, write, write_report};
use super::{CliError, progress};
use crate::evaluate::{
    BudgetRequest, Choice, Controlled, Evaluation, EvaluationPlan, PathPlan, Policy, Pose, PowerBudget, ResolvedBudget, evaluate,
    frames_csv, parse_error_budget, table,
};
use crate::report::{captioned, evaluation_report};
use crate::scene::SceneDescription;
use crate::stage::{RemoteStage, StageRequest};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The scene's map
    #[arg(long, value_name = "MAP")]
    map: PathBuf,
    /// Which of the scene's paths to play
    #[arg(long, value_name = "NAME", default_value = "tour")]
    path: String,
    /// Limit in watts, or as a share of the way from the cheapest settings' power to the best ones'
    #[arg(long, value_name = "7W|60%", allow_hyphen_values = true)]
    power_budget: Option<String>,
    /// Limit on the error, 1 − SSIM
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    error_budget: Option<String>,
    /// Power meter; without it, the map's
    #[arg(long, value_name = "NAME")]
    meter: Option<String>,
    /// Result for programs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Every frame of every run
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Folder for a page with pictures and plots
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let budget = BudgetRequest {
        power: arguments.power_budget.as_deref().map(str::parse::<PowerBudget>).transpose().map_err(CliError::usage)?,
        error: arguments.error_budget.as_deref().map(parse_error_budget).transpose().map_err(CliError::usage)?,
    };
    if budget.power.is_none() && budget.error.is_none() {
        return Err(CliError::usage("give --power-budget, --error-budget, or both"));
    }
    let (scene, name) = open_scene(&arguments.scene)?;
    let map = read_map(&arguments.map, &scene, &name)?;
    let path = plan_path(&scene, &arguments.path, map.capture.frames_per_second)?;
    check_outputs([arguments.json.as_ref(), arguments.csv.as_ref()])?;

    let mut stage = open_stage(&scene, &arguments.scene, &map, &arguments.map, arguments.meter.clone())?;
    let label = arguments.scene.display().to_string();
    let evaluation = play(&mut stage, &map, &label, &path, budget)?;
    println!("{}", table(&evaluation.result));
    if let Some(path) = &arguments.json {
        write(path, &json(&evaluation.result)?)?;
    }
    if let Some(path) = &arguments.csv {
        let mut rows = Vec::new();
        frames_csv(&evaluation.result, &map.knobs, &mut rows).map_err(CliError::failed)?;
        write(path, &rows)?;
    }
    if let Some(folder) = &arguments.report {
        write_report(folder, &evaluation_report(&evaluation.result, &captioned(&evaluation), &[])?)?;
    }
    Ok(())
}

/// Reads a map and holds it against the scene.
pub(super) fn read_map(path: &Path, scene: &SceneDescription, name: &str) -> Result<FrontierMap, CliError> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        CliError::usage(format!("{}: cannot be read: {error}; give a map written by frugal precompute", path.display()))
    })?;
    let map = FrontierMap::from_ron(&text).map_err(|error| CliError::usage(format!("{}: {error}", path.display())))?;
    let identity = SceneIdentity { name: name.to_owned(), fingerprint: scene.fingerprint()? };
    map.matches_scene(&identity).map_err(|error| CliError::usage(format!("{}: {error}", path.display())))?;
    Ok(map)
}

pub(super) fn plan_path(scene: &SceneDescription, name: &str, fps: f64) -> Result<PathPlan, CliError> {
    let Some(path) = scene.paths.get(name) else {
        let known: Vec<_> = scene.paths.keys().map(String::as_str).collect();
        let known = if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", known.join(", ")) };
        return Err(CliError::usage(format!("{}: no path `{name}`: {known}", scene.source.display())));
    };
    let start = path.start();
    let pose_at = |seconds: f64| {
        let pose = path
            .sample(start + seconds as f32)
            .unwrap_or(crate::scene::CameraPose { position: bevy::math::Vec3::ZERO, rotation: bevy::math::Quat::IDENTITY });
        Pose { position: pose.position, rotation: pose.rotation }
    };
    PathPlan::sample(name, f64::from(path.duration()), fps, pose_at).map_err(CliError::usage)
}

/// Stages `scene` as `map` was captured.
pub(super) fn open_stage(
    scene: &SceneDescription,
    scene_path: &Path,
    map: &FrontierMap,
    map_path: &Path,
    meter: Option<String>,
) -> Result<RemoteStage, CliError> {
    let here = crate::stage::every_knob()?;
    for knob in map.knobs.knobs() {
        let (path, name) = (map_path.display(), &knob.name);
        match here.index_of(name).map(|index| &here.knobs()[index]) {
            None => return Err(CliError::usage(format!("{path}: its knob `{name}` does not exist here: run frugal precompute again"))),
            Some(other) if other.levels != knob.levels => {
                return Err(CliError::usage(format!("{path}: its knob `{name}` has other levels here: run frugal precompute again")));
            }
            Some(_) => {}
        }
    }
    let request = StageRequest {
        scene: scene_path.to_owned(),
        size: map.capture.size,
        frames_per_second: map.capture.frames_per_second,
        knobs: Some(map.knobs.knobs().iter().map(|knob| knob.name.clone()).collect()),
        meter: meter.or_else(|| Some(map.meter.name.clone())),
    };
    let stage = RemoteStage::open(scene, request)?;
    Ok(stage)
}

/// Plays all runs.
pub(super) fn play(
    stage: &mut RemoteStage,
    map: &FrontierMap,
    scene: &str,
    path: &PathPlan,
    budget: BudgetRequest,
) -> Result<Evaluation, CliError> {
    let frames = path.poses().len();
    let keep = [frames / 4, frames / 2, 3 * frames / 4];
    let plan = EvaluationPlan { scene, space: &map.knobs, path, meter: stage.meter(), budget, keep_frames: &keep };
    let [width, height] = stage.size();
    let (fov, aspect) = (stage.vertical_fov_degrees().to_radians(), width as f32 / height as f32);
    stage.warm()?;

    let bar = progress::bar(0);
    let result = evaluate(stage, &plan, |budget| controller(map, *budget, fov, aspect), &mut |progress| {
        bar.set_length(progress.frames_total as u64);
        bar.set_position(progress.frames_done as u64);
        bar.set_message(format!("frames, {}", progress.run));
        if super::progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    result.map_err(CliError::failed)
}

/// The controller that an app has, without an app around it.
fn controller(map: &FrontierMap, budget: ResolvedBudget, vertical_fov: f32, aspect: f32) -> Box<dyn Policy + '_> {
    let correction = map.correction();
    let budget = Budget { power: budget.power_w, error: budget.error }.tightened(correction);
    let times = ControlSettings::default().times(&budget);
    let mut filter = SettingsFilter::default();
    let mut last = map.knobs.highest();
    Box::new(Controlled(move |_: usize, dt: f64, pose: &Pose| {
        let view = CameraView { position: pose.position, rotation: pose.rotation, vertical_fov, aspect };
        let Some(choice) = map.look_up(&view).and_then(|sample| select(sample.frontier, &budget)) else {
            return Choice::from(last);
        };
        last = filter.step(&map.knobs, choice.settings, dt, times);
        Choice { settings: last, predicted: Some(correction.predict(choice.cost)) }
    }))
}

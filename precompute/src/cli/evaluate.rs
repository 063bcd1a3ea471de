//! `frugal evaluate`: plays a path under budgets beside baselines.

use std::ops::ControlFlow;
use std::path::PathBuf;

use bevy_frugal_gi::control::ControlSettings;
use bevy_frugal_gi::frontier::{FrontierMap, SceneIdentity};

use super::arguments::{WorkerArguments, check_outputs, check_report, json, write, write_report};
use super::input::{open_scene, plan_path, read_map_of, stage_for_map};
use super::journal::{JournalUse, journal_header, open_journal, rendered_by};
use super::{CliError, progress};
use crate::evaluate::{
    BudgetRequest, Controller, Evaluation, EvaluationError, EvaluationPlan, EvaluationResult,
    Judged, PathPlan, PathRecord, Policy, PowerBudget, RecordError, SpotCheck, evaluate,
    frames_csv, judge, judged_table, parse_error_budget, settings_to_record, table,
};
use crate::journal::{Existing, Journal, JournalHeader, hash};
use crate::report::{captioned, evaluation_report};
use crate::stage::RemoteStage;

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
    /// Power budget in watts, or as a percentage between the power of the cheapest and of the best
    /// settings. One of each kind is one budget; several are one budget each
    #[arg(long, value_name = "7W|60%", allow_hyphen_values = true)]
    power_budget: Vec<String>,
    /// Budget of the mean error, 1 − SSIM
    #[arg(long, value_name = "E", allow_hyphen_values = true)]
    error_budget: Vec<String>,
    /// Baselines to compare with: all, simulated from a record of the path; presets and resolution,
    /// rendered; none
    #[arg(long, value_name = "WHICH", default_value = "quick")]
    baselines: Baselines,
    /// Record of the path to resume and extend: power and error of every setting in every frame
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// With a record: number of budgets, from the first, that are rendered as well
    #[arg(long, value_name = "N")]
    spot_checks: Option<usize>,
    /// Duration of transitions between settings, up and down, in seconds; default as in an app: 1
    /// s, and 0.5 s down under a power limit
    #[arg(long, value_name = "S", value_parser = transition, allow_hyphen_values = true)]
    transition: Option<f64>,
    /// Power meter; default: the map's. `work`: prices of work, the same in every run
    #[arg(long, value_name = "NAME")]
    meter: Option<String>,
    #[command(flatten)]
    workers: WorkerArguments,
    /// Result for programs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Every frame of every run
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Folder for a page with images and plots
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

/// Extent of the comparison.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Baselines {
    /// Constants, oracles, the reactive ladder, presets, resolution: from a record of the path
    All,
    /// Presets and resolution, rendered
    Quick,
    /// None: the frugal run alone, from a record
    None,
}

fn transition(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|seconds: &f64| *seconds >= 0.0)
        .ok_or_else(|| "expected seconds, 0 or more".to_owned())
}

impl Arguments {
    fn control(&self) -> ControlSettings {
        self.transition.map_or_else(ControlSettings::default, |seconds| ControlSettings {
            transition_seconds: seconds,
            fall_seconds: seconds,
            ..Default::default()
        })
    }

    /// Fails where an option would be ignored.
    fn check(&self, budgets: usize) -> Result<(), CliError> {
        let quick = self.baselines == Baselines::Quick;
        if quick && budgets > 1 {
            return Err(CliError::usage(
                "several budgets need a record: add --baselines all, or give one budget",
            ));
        }
        let of_record = [
            ("--record", self.record.is_some()),
            ("--spot-checks", self.spot_checks.is_some()),
            ("--workers", self.workers.several()),
        ];
        let of_one = [("--csv", self.csv.is_some()), ("--report", self.report.is_some())];
        if let Some((option, _)) = of_record.iter().find(|(_, given)| quick && *given) {
            return Err(CliError::usage(format!(
                "{option} is for a record: add --baselines all, or --baselines none"
            )));
        }
        if let Some((option, _)) = of_one.iter().find(|(_, given)| budgets > 1 && *given) {
            return Err(CliError::usage(format!(
                "{option} is for one budget, here are {budgets}: give one, or --json for all"
            )));
        }
        match self.spot_checks {
            Some(checks) if checks > budgets => Err(CliError::usage(format!(
                "--spot-checks {checks}: more than the budgets, {budgets}"
            ))),
            _ => Ok(()),
        }
    }

    /// The path's record.
    fn record_file(&self) -> PathBuf {
        let mut file = self.map.as_os_str().to_owned();
        file.push(format!(".{}.record", self.path));
        self.record.clone().unwrap_or_else(|| file.into())
    }

    fn budgets(&self) -> Result<Vec<BudgetRequest>, CliError> {
        let power = |text: &String| text.parse::<PowerBudget>().map_err(CliError::usage);
        let error = |text: &String| parse_error_budget(text).map_err(CliError::usage);
        if let ([one], [other]) = (&self.power_budget[..], &self.error_budget[..]) {
            return Ok(vec![BudgetRequest {
                power: Some(power(one)?),
                error: Some(error(other)?),
            }]);
        }
        let mut budgets = Vec::new();
        for text in &self.power_budget {
            budgets.push(BudgetRequest { power: Some(power(text)?), error: None });
        }
        for text in &self.error_budget {
            budgets.push(BudgetRequest { power: None, error: Some(error(text)?) });
        }
        if budgets.is_empty() {
            Err(CliError::usage("give --power-budget, --error-budget, or both"))
        } else {
            Ok(budgets)
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let budgets = arguments.budgets()?;
    arguments.check(budgets.len())?;
    let (scene, name) = open_scene(&arguments.scene)?;
    let map = read_map_of(&scene, &name, &arguments.map)?;
    let path = plan_path(&scene, &arguments.path, map.capture.frames_per_second)?;
    check_outputs([arguments.json.as_ref(), arguments.csv.as_ref()])?;
    check_report(arguments.report.as_ref())?;
    let header =
        record_header(&SceneIdentity { name, fingerprint: scene.fingerprint()? }, &map, &path);
    if arguments.baselines != Baselines::Quick {
        let file = arguments.record_file();
        check_outputs([Some(&file)])?;
        Journal::check(&file, &header, Existing::Resume)
            .map_err(|error| JournalUse::EVALUATE.refused(&error))?;
    }

    let meter = arguments.meter.clone();
    let request = stage_for_map(&scene, &map, &arguments.map, meter)?;
    let workers = arguments.workers.count(request.meter.as_deref())?;
    let mut stage = RemoteStage::open(&scene, request, workers)?;
    let label = arguments.scene.display().to_string();
    if arguments.baselines == Baselines::Quick {
        let evaluation = play(&mut stage, &map, &label, &path, budgets[0], arguments.control())?;
        println!("{}", table(&evaluation.result));
        return outputs(
            arguments,
            &map,
            std::slice::from_ref(&evaluation.result),
            Some(&evaluation),
        );
    }
    let record = record(&mut stage, &map, header, &path, arguments)?;
    let lens = stage.lens();
    let mut judged: Vec<Judged> = budgets
        .iter()
        .map(|budget| judge(&record, &map, lens, budget, arguments.control()))
        .collect();
    if arguments.baselines == Baselines::None {
        judged.iter_mut().for_each(|judged| judged.runs.truncate(1));
    }
    println!("{}", judged_table(&judged));
    let checks = spot_checks(&mut stage, &record, &map, &judged, arguments)?;
    let mut results: Vec<EvaluationResult> =
        judged.into_iter().map(|judged| result(judged, &label, &path, &stage)).collect();
    for (result, check) in results.iter_mut().zip(checks) {
        println!(
            "{}, rendered: {:.3} W, {:.4}; simulated from the record: {:.3} W, {:.4}",
            result.asked,
            check.mean_power_w.0,
            check.mean_error,
            check.recorded_mean_power_w.0,
            check.recorded_mean_error
        );
        result.spot_check = Some(check);
    }
    outputs(arguments, &map, &results, None)
}

/// Rendered frugal runs under the first budgets.
fn spot_checks(
    stage: &mut RemoteStage,
    record: &PathRecord,
    map: &FrontierMap,
    judged: &[Judged],
    arguments: &Arguments,
) -> Result<Vec<SpotCheck>, CliError> {
    let checked = &judged[..arguments.spot_checks.unwrap_or(0)];
    if checked.is_empty() {
        return Ok(Vec::new());
    }
    stage.warm()?;
    let (lens, control) = (stage.lens(), arguments.control());
    let policy = |judged: &Judged| -> Box<dyn Policy + '_> {
        Box::new(Controller::new(map, &judged.budget, lens, control))
    };
    let mut policies: Vec<_> = checked.iter().map(policy).collect();
    let bar = progress::bar(0);
    let played = record.render_runs(stage, &mut policies, &mut |progress| {
        bar.set_length(progress.frames_total as u64);
        bar.set_position(progress.frames_done as u64);
        bar.set_message("frames, rendered");
        if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    let played = played.map_err(CliError::failed)?;
    let ours = checked.iter().filter_map(|judged| judged.runs.first());
    Ok(played.iter().zip(ours).map(|(real, recorded)| SpotCheck::new(real, recorded)).collect())
}

fn result(judged: Judged, scene: &str, path: &PathPlan, stage: &RemoteStage) -> EvaluationResult {
    EvaluationResult {
        scene: scene.to_owned(),
        path: path.name().to_owned(),
        frames: path.poses().len(),
        fps: path.fps(),
        size: stage.size(),
        meter: stage.meter(),
        budget: judged.budget,
        asked: judged.asked,
        runs: judged.runs,
        drift: Default::default(),
        warnings: vec!["runs are simulated from a record of the path: settings in transitions of the filter are interpolated".to_owned()],
        gap_closed: judged.gap_closed,
        dominated_by: judged.dominated_by,
        spot_check: None,
    }
}

fn outputs(
    arguments: &Arguments,
    map: &FrontierMap,
    results: &[EvaluationResult],
    played: Option<&Evaluation>,
) -> Result<(), CliError> {
    if let Some(path) = &arguments.json {
        match results {
            [one] => write(path, &json(one)?)?,
            all => write(path, &json(&serde_json::json!({ "evaluations": all }))?)?,
        }
    }
    if let (Some(path), [result]) = (&arguments.csv, results) {
        let mut rows = Vec::new();
        frames_csv(result, &map.knobs, &mut rows).map_err(CliError::failed)?;
        write(path, &rows)?;
    }
    if let (Some(folder), [result]) = (&arguments.report, results) {
        let pictures = played.map(captioned).unwrap_or_default();
        write_report(folder, &evaluation_report(result, &pictures, &[])?)?;
    }
    Ok(())
}

/// The part of the record's header that is known before anything is rendered.
fn record_header(scene: &SceneIdentity, map: &FrontierMap, path: &PathPlan) -> JournalHeader {
    let poses = hash(&format!("{:?}", path.poses()));
    journal_header(scene, &map.capture).with("path", format!("{} {poses:016x}", path.name()))
}

/// The path's record: read, extended with every setting of the map, and kept.
fn record(
    stage: &mut RemoteStage,
    map: &FrontierMap,
    header: JournalHeader,
    path: &PathPlan,
    arguments: &Arguments,
) -> Result<PathRecord, CliError> {
    let (file, of) = (arguments.record_file(), JournalUse::EVALUATE);
    let header = rendered_by(header, &map.knobs, &stage.meter())?;
    let (mut journal, lines) = open_journal(&file, &header, Existing::Resume, of)?;
    let mut record = PathRecord::restore(path, &map.knobs, &lines);
    let settings = settings_to_record(map);
    let bar = progress::bar(0);
    if settings.iter().any(|settings| record.table.column(*settings).is_none()) {
        stage.warm()?;
    }
    let recorded = record.extend(stage.processes(), &settings, &mut journal, &mut |progress| {
        bar.set_length(progress.frames_total as u64);
        bar.set_position(progress.frames_done as u64);
        bar.set_message("frames of the path's record");
        if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    recorded.map_err(|error| match error {
        RecordError::Journal(error) => of.failed(&error),
        RecordError::Play(EvaluationError::Interrupted) => of.interrupted(),
        error => CliError::failed(error),
    })?;
    eprintln!(
        "{}: {} settings at {} frames",
        file.display(),
        record.table.settings().len(),
        record.table.rows()
    );
    Ok(record)
}

/// Renders all runs.
pub(super) fn play(
    stage: &mut RemoteStage,
    map: &FrontierMap,
    scene: &str,
    path: &PathPlan,
    budget: BudgetRequest,
    control: ControlSettings,
) -> Result<Evaluation, CliError> {
    let frames = path.poses().len();
    let keep = [frames / 4, frames / 2, 3 * frames / 4];
    let plan = EvaluationPlan {
        scene,
        space: &map.knobs,
        path,
        meter: stage.meter(),
        budget,
        trained: Some(&map.shared),
        keep_frames: &keep,
    };
    let lens = stage.lens();
    stage.warm()?;

    let bar = progress::bar(0);
    let result = evaluate(
        stage,
        &plan,
        |budget| Box::new(Controller::new(map, budget, lens, control)),
        &mut |progress| {
            bar.set_length(progress.frames_total as u64);
            bar.set_position(progress.frames_done as u64);
            bar.set_message(format!("frames, {}", progress.run));
            if progress::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    );
    bar.finish_and_clear();
    result.map_err(CliError::failed)
}

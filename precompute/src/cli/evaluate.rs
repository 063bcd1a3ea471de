//! `frugal evaluate`: plays a path under budgets beside baselines.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use frugal_core::control::ControlSettings;
use frugal_core::frontier::FrontierMap;
use frugal_search::evaluate::{
    Baselines, BudgetRequest, EvaluationResult, PathPlan, PathRecord, Policy, PowerBudget, Trial,
    parse_error_budget, settings_to_record,
};
use frugal_search::journal::{Existing, hash};
use frugal_search::pipeline::{PipelineError, Progress as Played};

use super::CliError;
use super::arguments::{
    Choices, SceneArguments, WorkerArguments, check_outputs, check_report, json, one_of, write,
    write_report,
};
use super::input::{check_meter, open_scene, plan_path, read_map, stage_for_map};
use super::journal::{JournalUse, journal_header, open_journal};
use super::progress::Progress;
use crate::evaluate::{self, frames_csv, play_for_real, table};
use crate::report::evaluation_report;
use crate::stage::{RemoteStage, StagedScene};
use bevy_frugal_gi::stage::default_settings;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// The scene's map
    #[arg(long, value_name = "MAP")]
    map: PathBuf,
    /// Which of the scene's paths to play, or a file that the plugin's recorder wrote
    #[arg(long, value_name = "NAME", default_value = "tour")]
    path: String,
    /// Power budget in watts, or as a percentage between the power of the cheapest and of the best
    /// settings. One of each kind is one budget; several are one budget each
    #[arg(long, value_name = "7W|60%", allow_hyphen_values = true)]
    power_budget: Vec<PowerBudget>,
    /// Budget of the mean error, 1 − SSIM
    #[arg(long, value_name = "E", value_parser = parse_error_budget, allow_hyphen_values = true)]
    error_budget: Vec<f64>,
    /// What budgets are means over, in seconds; below 1, every frame keeps them. Default: as in an app, 30
    #[arg(long, value_name = "S", value_parser = horizon, allow_hyphen_values = true)]
    horizon: Option<f64>,
    /// Baselines to compare with, all simulated from a record of the path. Quick ones are presets,
    /// resolution, and the constant by training cameras
    #[arg(long, value_name = "WHICH", default_value = "quick", value_parser = one_of(BASELINES))]
    baselines: Baselines,
    /// Record of the path to resume and extend: power and error of settings in every frame; default:
    /// beside the map, and none of quick comparisons
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Drop the record, and begin it anew
    #[arg(long)]
    overwrite: bool,
    /// Number of budgets, from the first, that are played for real as well; default: 1 of quick
    /// comparisons, else 0
    #[arg(long, value_name = "N")]
    spot_checks: Option<usize>,
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
    /// Folder for a page with plots
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

fn horizon(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| (0.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "expected seconds, 0 to 3600".to_owned())
}

/// The extents of a comparison.
const BASELINES: Choices<Baselines> = &[
    (
        "all",
        Baselines::All,
        "Constants, one frontier, oracles, the reactive ladder, presets, resolution",
    ),
    ("quick", Baselines::Quick, "Presets, resolution, and the constant by training cameras"),
    ("none", Baselines::None, "None: the frugal run alone"),
];

impl Arguments {
    /// Number of budgets to play for real.
    fn checks(&self) -> usize {
        self.spot_checks.unwrap_or(usize::from(self.baselines == Baselines::Quick))
    }

    /// Fails where an option would be ignored.
    fn check(&self, budgets: usize) -> Result<(), CliError> {
        let of_one = [("--csv", self.csv.is_some()), ("--report", self.report.is_some())];
        if let Some((option, _)) = of_one.iter().find(|(_, given)| budgets > 1 && *given) {
            return Err(CliError::usage(format!(
                "{option} is for one budget, here are {budgets}: give one, or --json for all"
            )));
        }
        if self.overwrite && self.record_file().is_none() {
            return Err(CliError::usage(
                "--overwrite: no record is kept: name it with --record, or leave the option out",
            ));
        }
        match self.spot_checks {
            Some(checks) if checks > budgets => Err(CliError::usage(format!(
                "--spot-checks {checks}: more than the budgets, {budgets}"
            ))),
            _ => Ok(()),
        }
    }

    /// The path's record where it is kept: quick comparisons measure anew unless told otherwise.
    fn record_file(&self) -> Option<PathBuf> {
        let beside_map = || {
            let mut file = self.map.as_os_str().to_owned();
            let path = Path::new(&self.path).file_stem().unwrap_or_default();
            file.push(format!(".{}.record", path.to_string_lossy()));
            PathBuf::from(file)
        };
        let is_kept = self.baselines != Baselines::Quick;
        self.record.clone().or_else(|| is_kept.then(beside_map))
    }

    fn budgets(&self) -> Result<Vec<BudgetRequest>, CliError> {
        let of = |power: Option<&PowerBudget>, error: Option<&f64>| BudgetRequest {
            power: power.copied(),
            error: error.copied(),
            horizon_s: self.horizon,
        };
        if let ([power], [error]) = (&self.power_budget[..], &self.error_budget[..]) {
            return Ok(vec![of(Some(power), Some(error))]);
        }
        let powers = self.power_budget.iter().map(|power| of(Some(power), None));
        let errors = self.error_budget.iter().map(|error| of(None, Some(error)));
        let budgets: Vec<_> = powers.chain(errors).collect();
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
    // Before an app is built.
    let (map, _) = read_map(&arguments.map)?;
    let kept = arguments.record_file();
    check_outputs([arguments.json.as_ref(), arguments.csv.as_ref(), kept.as_ref()])?;
    check_report(arguments.report.as_ref())?;
    let scene = open_scene(&arguments.scene)?;
    map.matches_scene(&scene.identity()?)
        .map_err(|error| CliError::in_file(&arguments.map, error))?;
    let path = plan_path(&scene, &arguments.path, map.capture.frames_per_second)?;
    let request = stage_for_map(&scene, &map, &arguments.map, arguments.meter.clone())?;
    let workers = arguments.workers.count(request.meter.as_deref())?;
    let mut stage = RemoteStage::open(&scene, request, workers)?;
    if arguments.meter.is_none() {
        check_meter(&map, &arguments.map, &stage.meter)?;
    }
    let record = record(&mut stage, &map, &scene, &path, arguments, kept)?;
    let (meter, label) = (stage.meter.clone(), scene.label.clone());
    let trial = Trial {
        scene: &label,
        record: &record,
        map: &map,
        lens: stage.lens,
        size: stage.size,
        meter: &meter,
        control: ControlSettings::default(),
        baselines: arguments.baselines,
        default: default_settings(&map.knobs),
    };
    let mut results: Vec<EvaluationResult> =
        budgets.iter().map(|budget| trial.judge(budget)).collect();
    // The record may have taken hours: results without their check are better than none.
    let checked = check(&mut stage, &trial, &mut results[..arguments.checks()]);
    for result in &results {
        println!("{}", table(result));
    }
    outputs(arguments, &map, &results)?;
    checked.map_err(|error| CliError::failed(format!("the results lack their spot check: {error}")))
}

/// Plays frugal runs for real.
fn check(
    stage: &mut RemoteStage,
    trial: &Trial<'_>,
    results: &mut [EvaluationResult],
) -> Result<(), CliError> {
    if results.is_empty() {
        return Ok(());
    }
    let policy = |result: &EvaluationResult| -> Box<dyn Policy + '_> {
        Box::new(trial.controller(&result.budget))
    };
    let mut policies: Vec<_> = results.iter().map(policy).collect();
    let (path, best) = (&trial.record.path, trial.map.knobs.highest());
    stage.warm()?;
    let renderer = &mut stage.processes[0];
    let (runs, drift) =
        with_progress(|on_frame| play_for_real(renderer, path, best, &mut policies, on_frame))
            .map_err(CliError::failed)?;
    for (result, run) in results.iter_mut().zip(&runs) {
        let simulated = trial.record.simulate(&mut trial.controller(&result.budget));
        result.add_check(run, &simulated, drift);
    }
    Ok(())
}

/// What to do after each frame of a play.
type OnFrame<'a> = &'a mut dyn FnMut(&Played<'_>) -> ControlFlow<()>;

/// Plays frames, and shows their progress.
fn with_progress<T>(play: impl FnOnce(OnFrame<'_>) -> T) -> T {
    let shown = Progress::new(0, "frames");
    play(&mut |progress| {
        shown.at(progress.done, progress.total, format!("frames, {}", progress.stage))
    })
}

fn outputs(
    arguments: &Arguments,
    map: &FrontierMap,
    results: &[EvaluationResult],
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
        write_report(folder, &evaluation_report(result).map_err(CliError::failed)?)?;
    }
    Ok(())
}

/// The path's record: read where it is `kept`, extended with what the comparison needs.
fn record(
    stage: &mut RemoteStage,
    map: &FrontierMap,
    scene: &StagedScene,
    path: &PathPlan,
    arguments: &Arguments,
    kept: Option<PathBuf>,
) -> Result<PathRecord, CliError> {
    let of = JournalUse::Evaluate;
    let scratch = tempfile::tempdir().map_err(CliError::failed)?;
    let file = kept.clone().unwrap_or_else(|| scratch.path().join("record"));
    let poses = hash(&format!("{:?}", path.poses()));
    let (identity, content) = (scene.identity()?, scene.content()?);
    let header = journal_header(&identity, content, &map.capture, &map.knobs, &stage.meter)?
        .with("path", format!("{} {poses:016x}", path.name()));
    let existing = if arguments.overwrite { Existing::Overwrite } else { Existing::Resume };
    let (mut journal, lines) = open_journal(&file, &header, existing, of, &[])?;
    let mut record = PathRecord::restore(path, &map.knobs, &lines);
    let settings = settings_to_record(map, arguments.baselines, default_settings(&map.knobs));
    if settings.iter().any(|settings| record.table.column(*settings).is_none()) {
        stage.warm()?;
    }
    let recorded = with_progress(|on_frame| {
        evaluate::extend(&mut record, &mut stage.processes, &settings, &mut journal, on_frame)
    });
    recorded.map_err(|error| match error {
        PipelineError::Interrupted if kept.is_none() => CliError::failed(
            "interrupted: nothing was written; --record FILE keeps what is rendered",
        ),
        error => of.ended(error),
    })?;
    eprintln!(
        "recorded {} settings at {} frames",
        record.table.settings().len(),
        record.table.rows()
    );
    Ok(record)
}

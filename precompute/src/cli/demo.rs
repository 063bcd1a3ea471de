//! `frugal demo`: precompute, evaluate and report in one command.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::arguments::{CaptureArguments, check_outputs, json, open_scene, write};
use super::evaluate::{plan_path, play};
use super::journal::{JournalUse, journal_path};
use super::precompute::{SearchArguments, SearchPlan, open_stage, print_outcome, search};
use super::{CliError, inspect};
use crate::evaluate::{BudgetRequest, PowerBudget, table};
use crate::journal::Existing;
use crate::report::{Report, captioned, evaluation_section, map_section, search_section};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene; it needs a path called `tour`
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Folder for the map, both results and the report
    #[arg(short, long, value_name = "DIR", default_value = "target/demo")]
    output: PathBuf,
    #[command(flatten)]
    capture: CaptureArguments,
    #[command(flatten)]
    search: SearchArguments,
    /// Power budget: watts or a share of the range
    #[arg(long, value_name = "7W|60%", default_value = "60%", allow_hyphen_values = true)]
    power_budget: PowerBudget,
    /// Error budget, 1 − SSIM
    #[arg(long, value_name = "E", default_value = "0.02", allow_hyphen_values = true)]
    error_budget: String,
    /// Begin anew, and drop the search of an earlier demo in the folder; without it an interrupted
    /// demo continues
    #[arg(long)]
    overwrite: bool,
}

/// The path that is played.
const PATH: &str = "tour";

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let error =
        crate::evaluate::parse_error_budget(&arguments.error_budget).map_err(CliError::usage)?;
    let (scene, name) = open_scene(&arguments.scene)?;
    if !scene.paths.contains_key(PATH) {
        return Err(CliError::usage(format!(
            "{}: it has no path `{PATH}`, which the demo plays: give it one, or name one of its paths so",
            arguments.scene.display()
        )));
    }
    let path = plan_path(&scene, PATH, arguments.capture.image.fps)?;
    let folder = &arguments.output;
    std::fs::create_dir_all(folder).map_err(|error| {
        CliError::usage(format!("cannot make the folder {}: {error}", folder.display()))
    })?;
    let map_path = folder.join(format!("{name}.pareto.ron"));
    let report_path = folder.join("report.html");
    let [power_path, error_path] =
        ["power", "error"].map(|kind| folder.join(format!("evaluate-{kind}.json")));
    check_outputs([&map_path, &report_path, &power_path, &error_path].map(Some))?;

    let mut search_arguments = arguments.search.clone();
    if search_arguments.tracks.paths.is_empty() {
        // The path of the evaluation.
        search_arguments.tracks.paths.push(PATH.to_owned());
    }
    search_arguments.check()?;
    let tracks = search_arguments.tracks.tracks(&scene, arguments.capture.image.fps)?;
    let plan = SearchPlan {
        scene: &scene,
        name: &name,
        tracks: &tracks,
        capture: &arguments.capture,
        arguments: &search_arguments,
        shard: (0, 1),
        journal: journal_path(&map_path, None),
        existing: if arguments.overwrite { Existing::Overwrite } else { Existing::Resume },
        of: JournalUse::DEMO,
    };
    plan.check_journal()?;
    let mut stage = open_stage(&scene, &arguments.scene, &arguments.capture, NonZeroUsize::MIN)?;
    let searched = search(&mut stage, &plan)?;
    let map = &searched.map;
    write(&map_path, map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    // Not before the map is on disk.
    let _ = std::fs::remove_file(&plan.journal);
    print_outcome(&searched);

    let mut report = Report::new(&format!("frugal: {name}"));
    report.facts(&facts(&arguments.scene));
    report.section(search_section(&searched.summary())?);
    report.section(map_section(&inspect::summary(map))?);
    let budgets = [
        (power_path, BudgetRequest { power: Some(arguments.power_budget), error: None }),
        (error_path, BudgetRequest { power: None, error: Some(error) }),
    ];
    for (result_path, budget) in budgets {
        let evaluation = play(
            &mut stage,
            map,
            &arguments.scene.display().to_string(),
            &path,
            budget,
            bevy_frugal_gi::control::ControlSettings::default(),
        )?;
        println!("\n{}", table(&evaluation.result));
        write(&result_path, &json(&evaluation.result)?)?;
        report.section(evaluation_section(&evaluation.result, &captioned(&evaluation))?);
    }
    write(&report_path, report.render().as_bytes())
}

fn facts(scene: &Path) -> Vec<(String, String)> {
    let adapter = crate::stage::adapter().map_or("none".to_owned(), |adapter| adapter.name);
    vec![("scene".to_owned(), scene.display().to_string()), ("adapter".to_owned(), adapter)]
}

//! `frugal demo`: precompute, evaluate and report in one command.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use super::arguments::{CaptureArguments, json, open_scene, write};
use super::evaluate::{plan_path, play};
use super::precompute::{SearchArguments, journal_path, open_stage, print_outcome, search};
use super::{CliError, inspect};
use crate::evaluate::{BudgetRequest, PowerBudget, table};
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
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let error =
        crate::evaluate::parse_error_budget(&arguments.error_budget).map_err(CliError::usage)?;
    let (scene, name) = open_scene(&arguments.scene)?;
    let path = plan_path(&scene, "tour", arguments.capture.fps)?;
    let folder = &arguments.output;
    std::fs::create_dir_all(folder).map_err(|error| {
        CliError::usage(format!("cannot make the folder {}: {error}", folder.display()))
    })?;

    let mut search_arguments = arguments.search.clone();
    if search_arguments.tracks.paths.is_empty() {
        // The path of the evaluation.
        search_arguments.tracks.paths.push("tour".to_owned());
    }
    search_arguments.check()?;
    let tracks = search_arguments.tracks.tracks(&scene, arguments.capture.fps)?;
    let mut stage = open_stage(&scene, &arguments.scene, &arguments.capture, NonZeroUsize::MIN)?;
    let map_path = folder.join(format!("{name}.pareto.ron"));
    let journal = journal_path(&map_path, None);
    let searched = search(&mut stage, &scene, &name, &tracks, &search_arguments, &journal, false)?;
    let map = &searched.map;
    let _ = std::fs::remove_file(&journal);
    write(&map_path, map.to_ron().map_err(CliError::failed)?.as_bytes())?;
    print_outcome(&searched);

    let mut report = Report::new(&format!("frugal: {name}"));
    report.facts(&facts(&arguments.scene));
    report.section(search_section(&searched.summary())?);
    report.section(map_section(&inspect::summary(map))?);
    let budgets = [
        ("power", BudgetRequest { power: Some(arguments.power_budget), error: None }),
        ("error", BudgetRequest { power: None, error: Some(error) }),
    ];
    for (kind, budget) in budgets {
        let evaluation = play(
            &mut stage,
            map,
            &arguments.scene.display().to_string(),
            &path,
            budget,
            bevy_frugal_gi::control::ControlSettings::default(),
        )?;
        println!("\n{}", table(&evaluation.result));
        write(&folder.join(format!("evaluate-{kind}.json")), &json(&evaluation.result)?)?;
        report.section(evaluation_section(&evaluation.result, &captioned(&evaluation))?);
    }
    write(&folder.join("report.html"), report.render().as_bytes())
}

fn facts(scene: &Path) -> Vec<(String, String)> {
    let adapter = crate::stage::adapter().map_or("none".to_owned(), |adapter| adapter.name);
    vec![("scene".to_owned(), scene.display().to_string()), ("adapter".to_owned(), adapter)]
}

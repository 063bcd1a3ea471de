//! The command line: one file per command.
//!
//! Exit status: 0 done, 2 invalid arguments or input (one message, nothing written), 1 failed, 3 power
//! rose (`inspect --compare`).

mod arguments;
mod calibrate;
mod compare;
mod evaluate;
mod input;
mod inspect;
mod journal;
mod merge;
mod plot_log;
mod precompute;
mod progress;
mod reference;
mod render;
mod reprice;

use std::fmt::Display;
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::scene::SceneError;
use crate::stage::StageError;

/// Finds Pareto-optimal rendering settings in power and error for every camera of a scene.
#[derive(Parser, Debug)]
#[command(name = "frugal", version, about, max_term_width = 120)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Searches a scene's camera space and writes its frontier map
    Precompute(precompute::Arguments),
    /// Plays a camera path under a budget beside baselines
    Evaluate(evaluate::Arguments),
    /// Renders one image
    Render(render::Arguments),
    /// Path-traces one image on the CPU: the reference for `render`
    Reference(reference::Arguments),
    /// Compares the linear radiance of two images
    Compare(compare::Arguments),
    /// Summarises a map, takes presets from it, or compares its power with an older map's
    Inspect(inspect::Arguments),
    /// Fits prices of work on this device, for maps that were made elsewhere
    Calibrate(calibrate::Arguments),
    /// Recomputes a map's power for another device, size or frame rate
    Reprice(reprice::Arguments),
    /// Joins the journals of a run's shards
    Merge(merge::Arguments),
    /// Lists the power meters of this machine, each tested under load
    #[command(
        after_help = "FRUGAL_SYS_ROOT=FOLDER reads FOLDER/sys in place of /sys, for fake trees."
    )]
    Meters,
    /// Plots the control log of an app: power, error, frame times and switches under its budgets
    #[command(alias = "report")]
    PlotLog(plot_log::Arguments),
    /// Renders a scene file for another process
    #[command(hide = true)]
    StageWorker,
    /// Runs an app for another process
    #[command(hide = true)]
    StageGuard {
        /// For the system's shell
        command: String,
    },
}

/// Runs the process's command line.
pub fn run() -> ExitCode {
    end_when_nobody_reads();
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Precompute(arguments) => precompute::run(arguments),
        Command::Evaluate(arguments) => evaluate::run(arguments),
        Command::Render(arguments) => render::run(arguments),
        Command::Reference(arguments) => reference::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Inspect(arguments) => inspect::run(arguments),
        Command::Calibrate(arguments) => calibrate::run(arguments),
        Command::Reprice(arguments) => reprice::run(arguments),
        Command::Merge(arguments) => merge::run(arguments),
        Command::Meters => {
            calibrate::meters();
            Ok(())
        }
        Command::PlotLog(arguments) => plot_log::run(arguments),
        Command::StageWorker => {
            crate::stage::serve();
            Ok(())
        }
        Command::StageGuard { command } => return crate::stage::guard(command),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("frugal: {error}");
            ExitCode::from(error.status)
        }
    }
}

/// Ends the process quietly when its output is closed (`frugal compare | head -1`), where Rust
/// would panic. The default SIGPIPE action is no alternative: it would also end this process when a
/// stage's process dies, which must be reported.
fn end_when_nobody_reads() {
    let otherwise = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let message = panic.payload_as_str().unwrap_or_default();
        if message.starts_with("failed printing to stdout") && message.contains("Broken pipe") {
            std::process::exit(0);
        }
        otherwise(panic);
    }));
}

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
struct CliError {
    /// The process's exit status.
    status: u8,
    message: String,
}

impl CliError {
    /// Invalid arguments or input: nothing was written.
    fn usage(error: impl ToString) -> Self {
        Self { status: 2, message: error.to_string() }
    }

    /// The same in a file.
    fn in_file(path: &Path, error: impl Display) -> Self {
        Self::usage(format!("{}: {error}", path.display()))
    }

    /// The command failed after it had started.
    fn failed(error: impl ToString) -> Self {
        Self { status: 1, message: error.to_string() }
    }
}

impl From<SceneError> for CliError {
    fn from(error: SceneError) -> Self {
        Self::usage(error)
    }
}

impl From<StageError> for CliError {
    fn from(error: StageError) -> Self {
        if error.usage { Self::usage(error) } else { Self::failed(error) }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    /// Words like `--resume` in `text`.
    fn options_in(text: &str) -> impl Iterator<Item = &str> {
        let is_word =
            |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-';
        text.match_indices("--").filter_map(move |(at, _)| {
            let name = &text[at + 2..];
            let name = &name[..name.find(|letter| !is_word(letter)).unwrap_or(name.len())];
            (name.len() > 1 && !name.starts_with('-')).then_some(name)
        })
    }

    /// Asserts that all options in `said` are the command's.
    pub(in crate::cli) fn assert_options_of(name: &str, said: &[String]) {
        let cli = Cli::command();
        let command = cli.find_subcommand(name).unwrap_or_else(|| panic!("no command `{name}`"));
        for option in said.iter().flat_map(|text| options_in(text)) {
            let is_there = command.get_arguments().any(|it| it.get_long() == Some(option));
            assert!(is_there, "`{name}` has no --{option}: {said:?}");
        }
    }

    #[test]
    fn no_message_of_a_command_names_an_option_that_it_lacks() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/cli");
        let read = |file: &Path| {
            let text = std::fs::read_to_string(file).expect("a source file");
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            // Comments are help, which names what clap knows; other commands are named in full.
            let lines = code.lines().filter(|line| !line.trim().starts_with("//"));
            lines.filter(|line| !line.contains("frugal ")).map(str::to_owned).collect::<Vec<_>>()
        };
        let cli = Cli::command();
        // The list of meters says what `--meter` of other commands takes.
        let names = cli.get_subcommands().map(clap::Command::get_name);
        for name in names.filter(|name| *name != "meters") {
            let files = if folder.join(name).is_dir() {
                let entries = std::fs::read_dir(folder.join(name)).expect("a folder");
                entries.map(|entry| entry.expect("a file").path()).collect()
            } else {
                vec![folder.join(format!("{}.rs", name.replace('-', "_")))]
            };
            for file in files.iter().filter(|file| file.exists()) {
                assert_options_of(name, &read(file));
            }
        }
    }
}

//! Integration tests on a real adapter. Where there is none, tests that need one are ignored, and counted as such: none is green.

use libtest_mimic::{Arguments, Trial};

/// Names a module's tests for `main`.
macro_rules! tests {
    ($($test:ident),+ $(,)?) => {
        pub const TESTS: &[(&str, fn())] = &[$((stringify!($test), $test)),+];
    };
}

mod cli;
mod cli_journal;
mod command;
mod contracts;
mod control;
mod extremes;
mod furnace;
mod gi;
mod gi_sources;
mod golden;
mod knobs;
mod materials;
mod naive;
mod refresh;
mod sampling;
mod shaders;
mod stability;
mod visibility;

/// Tests by module, and whether they need an adapter.
const MODULES: &[(&str, &[(&str, fn())], bool)] = &[
    ("cli", cli::TESTS, false),
    ("cli_journal", cli_journal::TESTS, true),
    ("contracts", contracts::TESTS, true),
    ("control", control::TESTS, true),
    ("extremes::counts", extremes::counts::TESTS, true),
    ("extremes::energy", extremes::energy::TESTS, true),
    ("extremes::filter", extremes::filter::TESTS, true),
    ("extremes::gather", extremes::gather::TESTS, true),
    ("extremes::history", extremes::history::TESTS, true),
    ("extremes::lights", extremes::lights::TESTS, true),
    ("extremes::maps", extremes::maps::TESTS, true),
    ("extremes::rays", extremes::rays::TESTS, true),
    ("extremes::shading", extremes::shading::TESTS, true),
    ("extremes::scenes", extremes::scenes::TESTS, true),
    ("extremes::views", extremes::views::TESTS, true),
    ("furnace", furnace::TESTS, true),
    ("gi", gi::TESTS, true),
    ("gi_sources", gi_sources::TESTS, true),
    ("golden", golden::TESTS, true),
    ("knobs", knobs::TESTS, true),
    ("materials::custom", materials::custom::TESTS, true),
    ("materials::shaped", materials::shaped::TESTS, true),
    ("materials::standard", materials::standard::TESTS, true),
    ("naive", naive::TESTS, true),
    ("refresh", refresh::TESTS, true),
    ("sampling", sampling::TESTS, true),
    ("shaders", shaders::TESTS, false),
    ("stability", stability::TESTS, true),
    ("visibility", visibility::TESTS, true),
];

fn main() {
    let mut arguments = Arguments::from_args();
    // A software adapter takes every core for one stage; side by side they would only be slower, and their output mixed up.
    arguments.test_threads.get_or_insert(1);
    let no_adapter = !arguments.list && frugal::stage::adapter().is_none();
    if no_adapter {
        eprintln!("no graphics adapter: the tests that need one are ignored");
    }
    let trials = MODULES.iter().copied().flat_map(|(module, tests, needs_adapter)| {
        tests.iter().map(move |(name, test)| {
            let test = *test;
            let run = move || {
                let start = std::time::Instant::now();
                test();
                println!("    {:.1} s", start.elapsed().as_secs_f64());
                Ok(())
            };
            Trial::test(format!("{module}::{name}"), run).with_ignored_flag(needs_adapter && no_adapter)
        })
    });
    libtest_mimic::run(&arguments, trials.collect()).exit();
}

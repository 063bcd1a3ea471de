//! Integration tests on a real adapter. Without one, tests that need an adapter are reported as
//! ignored, not as passed.

use libtest_mimic::{Arguments, Trial};

/// Lists a module's tests for `main`.
macro_rules! tests {
    ($($test:ident),+ $(,)?) => {
        pub(crate) const TESTS: &[(&str, fn())] = &[$((stringify!($test), $test)),+];
    };
}

mod architecture;
mod attenuation;
mod bounces;
mod cache;
mod cli;
mod command;
mod contracts;
mod control;
mod distant;
mod error_meter;
mod extremes;
mod fog;
mod forward;
mod furnace;
mod gi;
mod gi_sources;
mod golden;
mod knobs;
mod layers;
mod many_lights;
mod materials;
mod naive;
mod refresh;
mod resolution;
mod sampling;
mod shaders;
mod skylight;
mod stability;
mod time_of_flight;
mod viewports;
mod visibility;
mod weak;
mod worlds;

/// Modules, their tests, and whether these need an adapter.
const MODULES: &[(&str, &[(&str, fn())], bool)] = &[
    ("architecture", architecture::TESTS, false),
    ("attenuation", attenuation::TESTS, true),
    ("bounces::changes", bounces::changes::TESTS, true),
    ("bounces::light", bounces::light::TESTS, true),
    ("bounces::limits", bounces::limits::TESTS, true),
    ("cache", cache::TESTS, true),
    ("cli::analysis", cli::analysis::TESTS, false),
    ("cli::app", cli::app::TESTS, true),
    ("cli::counted", cli::counted::TESTS, true),
    ("cli::input", cli::input::TESTS, false),
    ("cli::journal", cli::journal::TESTS, true),
    ("cli::outputs", cli::outputs::TESTS, false),
    ("cli::stage", cli::stage::TESTS, true),
    ("contracts", contracts::TESTS, true),
    ("control", control::TESTS, true),
    ("distant", distant::TESTS, true),
    ("error_meter", error_meter::TESTS, true),
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
    ("fog", fog::TESTS, true),
    ("forward", forward::TESTS, true),
    ("furnace", furnace::TESTS, true),
    ("gi", gi::TESTS, true),
    ("gi_sources::emissive", gi_sources::emissive::TESTS, true),
    ("gi_sources::sky", gi_sources::sky::TESTS, true),
    ("golden", golden::TESTS, true),
    ("knobs", knobs::TESTS, true),
    ("layers", layers::TESTS, true),
    ("many_lights", many_lights::TESTS, true),
    ("materials::custom", materials::custom::TESTS, true),
    ("materials::shaped", materials::shaped::TESTS, true),
    ("materials::standard", materials::standard::TESTS, true),
    ("naive", naive::TESTS, true),
    ("refresh", refresh::TESTS, true),
    ("resolution", resolution::TESTS, true),
    ("sampling", sampling::TESTS, true),
    ("shaders", shaders::TESTS, false),
    ("skylight", skylight::TESTS, true),
    ("stability", stability::TESTS, true),
    ("time_of_flight", time_of_flight::TESTS, true),
    ("viewports", viewports::TESTS, true),
    ("visibility", visibility::TESTS, true),
    ("weak", weak::TESTS, true),
    ("worlds", worlds::TESTS, true),
];

/// Environment variable: the number of the part to run.
const PART: &str = "FRUGAL_TESTS_PART";
/// Number of processes of a complete run, one after another. Mesa 22's software driver leaks memory
/// in every frame: without a newer driver, a single process would exceed the limit of
/// `scripts/run`.
const PARTS: usize = 4;

fn main() {
    let mut arguments = Arguments::from_args();
    // A software adapter uses every core for one stage: parallel tests would be slower and mix
    // their output.
    arguments.test_threads.get_or_insert(1);
    let part = std::env::var(PART).ok().and_then(|part| part.parse::<usize>().ok());
    if part.is_none() && arguments.filter.is_none() && !arguments.list {
        run_parts();
    }
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
            Trial::test(format!("{module}::{name}"), run)
                .with_ignored_flag(needs_adapter && no_adapter)
        })
    });
    let all: Vec<Trial> = trials.collect();
    let share = all.len().div_ceil(PARTS).max(1);
    let own = all
        .into_iter()
        .enumerate()
        .filter(|(index, _)| part.is_none_or(|part| index / share == part))
        .map(|(_, trial)| trial);
    libtest_mimic::run(&arguments, own.collect()).exit();
}

/// Runs every part in its own process; fails if any of them fails.
fn run_parts() -> ! {
    let program = std::env::current_exe().expect("the path of this program");
    let mut failed = false;
    for part in 0..PARTS {
        let status = std::process::Command::new(&program)
            .args(std::env::args_os().skip(1))
            .env(PART, part.to_string())
            .status();
        failed |= !status.is_ok_and(|status| status.success());
    }
    std::process::exit(i32::from(failed) * 101);
}

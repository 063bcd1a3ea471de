//! `frugal regret`: how much power a map wastes at cameras that it has not seen.

use std::path::PathBuf;

use bevy_frugal_gi::frontier::{FrontierMap, SceneIdentity};
use serde::Serialize;

use super::arguments::{WorkerArguments, check_outputs, json, open_scene, write};
use super::evaluate::{open_stage, read_map};
use super::journal::{JournalArguments, JournalUse, journal_header, open_journal, rendered_by};
use super::precompute::TrackArguments;
use super::{CliError, progress};
use crate::cameras::{CameraMix, CameraSet};
use crate::cost::FrameLayout;
use crate::journal::{Journal, hash};
use crate::pipeline::{CLIP_FRAMES, Extent, PipelineError, Setup};
use crate::quantile::quantile;
use crate::regret::{AtCamera, CameraRegret, RegretPlan, run as run_regret};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The scene's map
    #[arg(long, value_name = "MAP")]
    map: PathBuf,
    #[command(flatten)]
    tracks: TrackArguments,
    /// Cameras, sampled as training cameras are, from another seed
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    unseen: u32,
    /// Cameras at which a search is made
    #[arg(long, value_name = "N", default_value_t = 10)]
    searched: usize,
    /// Renderings of each search; default: 200
    #[arg(long, value_name = "N")]
    renderings: Option<usize>,
    /// Error budgets, 1 − SSIM
    #[arg(long, value_name = "E1,E2,…", value_delimiter = ',', default_value = "0.005,0.01,0.015,0.02,0.03,0.05", value_parser = crate::evaluate::parse_error_budget)]
    budgets: Vec<f64>,
    /// Seed of the cameras and of the searches; not that of the map, whose cameras it trained on
    #[arg(long, value_name = "N", default_value_t = 1_000_003)]
    seed: u64,
    /// Power meter; default: the map's. `work`: prices of work, the same in every run
    #[arg(long, value_name = "NAME")]
    meter: Option<String>,
    #[command(flatten)]
    workers: WorkerArguments,
    /// Result for programs
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    journal: JournalArguments,
}

/// The result for programs.
#[derive(Serialize)]
struct RegretResult<'a> {
    scene: String,
    map: String,
    budgets: Vec<BudgetRegret>,
    cameras: &'a [CameraRegret],
}

/// One budget over all cameras.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct BudgetRegret {
    /// The error budget.
    budget: f64,
    /// Mean error at all cameras.
    mean_error: f64,
    /// Mean power at all cameras, watts.
    mean_power_w: f64,
    /// Number of cameras with a search.
    searched: usize,
    /// Quantiles of the regret at these: 25, 50, 75 and 90 %, and the greatest.
    quantiles: [f64; 5],
    /// Mean power at these above the mean of the least, as a part of it.
    of_means: f64,
}

/// Renderings of a search, unless others are asked for.
const RENDERINGS: usize = 200;

/// Quantiles of [`BudgetRegret`].
const SHARES: [f64; 5] = [0.25, 0.5, 0.75, 0.9, 1.0];

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (scene, name) = open_scene(&arguments.scene)?;
    check_outputs([arguments.json.as_ref()])?;
    let map = read_map(&arguments.map, &scene, &name)?;
    if arguments.seed == map.seed {
        return Err(CliError::usage(format!(
            "--seed {}: the map was trained on the cameras of this seed: give another one",
            map.seed
        )));
    }
    if arguments.searched == 0 && arguments.renderings.is_some() {
        return Err(CliError::usage("--renderings is for searches: raise --searched above 0"));
    }
    let tracks = arguments.tracks.tracks(&scene, map.capture.frames_per_second)?;
    let mut file = arguments.map.as_os_str().to_owned();
    file.push(".regret.journal");
    let file = PathBuf::from(file);
    let identity = SceneIdentity { name: name.clone(), fingerprint: scene.fingerprint()? };
    let (existing, of) = (arguments.journal.existing(), JournalUse::REGRET);
    let header = journal_header(&identity, &map.capture)
        .with("map", format!("{:016x}", hash(&map.to_ron().map_err(CliError::failed)?)))
        .with("seed", arguments.seed)
        .with("number of cameras", arguments.unseen);
    check_outputs([Some(&file)])?;
    Journal::check(&file, &header, existing).map_err(|error| of.refused(&error))?;
    let meter = arguments.meter.clone();
    let workers = &arguments.workers;
    let mut stage = open_stage(&scene, &arguments.scene, &map, &arguments.map, meter, workers)?;
    let bounds = scene.camera_bounds();
    let (mix, lens) = (CameraMix::default(), stage.lens());
    let counts = [arguments.unseen as usize, 0, 0];
    let cameras =
        CameraSet::sample(&scene.rays, &bounds, &tracks, counts, &mix, lens, arguments.seed);
    let layout = FrameLayout::of(&scene, stage.size());
    let plan = RegretPlan {
        map: &map,
        layout: &layout,
        budgets: &arguments.budgets,
        searched: arguments.searched,
        renderings: arguments.renderings.unwrap_or(RENDERINGS),
        batch: Extent::WHOLE.batch,
        seed: arguments.seed,
    };

    let header = rendered_by(header, &map.knobs, &stage.meter())?
        .with("set of cameras", format!("{:016x}", hash(&format!("{cameras:?}"))));
    let journal = open_journal(&file, &header, existing, of)?;
    stage.warm()?;
    let bar = progress::bar(0);
    let mut report = progress::of_renderings(&bar);
    let setup = Setup {
        measure: &mut stage,
        journal,
        cameras: &cameras,
        clip: (CLIP_FRAMES, map.capture.frames_per_second),
        shard: (0, 1),
        limit: None,
        report: &mut report,
    };
    let found = run_regret(&plan, lens, setup);
    bar.finish_and_clear();
    let found = found.map_err(|error| match error {
        PipelineError::Interrupted => of.interrupted(),
        PipelineError::Journal(error) => of.failed(&error),
        error => CliError::failed(error),
    })?;
    let budgets: Vec<BudgetRegret> =
        (0..arguments.budgets.len()).map(|number| of_budget(&found, number)).collect();
    print!("{}", text(&map, &found, &budgets));
    if let Some(path) = &arguments.json {
        let result = RegretResult {
            scene: arguments.scene.display().to_string(),
            map: arguments.map.display().to_string(),
            budgets,
            cameras: &found,
        };
        write(path, &json(&result)?)?;
    }
    // The run is complete: its journal is not needed.
    let _ = std::fs::remove_file(&file);
    Ok(())
}

fn of_budget(cameras: &[CameraRegret], number: usize) -> BudgetRegret {
    let all: Vec<&AtCamera> =
        cameras.iter().filter_map(|camera| camera.budgets.get(number)).collect();
    let mean = |value: fn(&AtCamera) -> f64| {
        all.iter().map(|at| value(at)).sum::<f64>() / all.len().max(1) as f64
    };
    let mut regrets: Vec<f64> = all.iter().filter_map(|at| at.regret()).collect();
    regrets.sort_by(f64::total_cmp);
    let pairs = || all.iter().filter_map(|at| Some((at.power_w, at.least_w?)));
    let [power, least] =
        [pairs().map(|pair| pair.0).sum::<f64>(), pairs().map(|pair| pair.1).sum()];
    BudgetRegret {
        budget: all.first().map_or(0.0, |at| at.budget),
        mean_error: mean(|at| at.error),
        mean_power_w: mean(|at| at.power_w),
        searched: regrets.len(),
        quantiles: SHARES.map(|share| quantile(&regrets, share)),
        of_means: if least > 0.0 { power / least - 1.0 } else { 0.0 },
    }
}

fn text(map: &FrontierMap, cameras: &[CameraRegret], budgets: &[BudgetRegret]) -> String {
    let rendered: usize = cameras.iter().map(|camera| camera.rendered).sum();
    let searched = budgets.first().map_or(0, |budget| budget.searched);
    let mut text = format!(
        "{}: {} cameras, {rendered} renderings; searches at {searched} of them. Power by {}.\n\
         Regret: power of the selections above the least of as little error that a search finds there.\n\n\
         error budget  mean error  mean W   regret: 25 %    50 %    75 %    90 %    most   of means\n",
        map.scene.name,
        cameras.len(),
        map.meter.name
    );
    for budget in budgets {
        let quantiles: String =
            budget.quantiles.iter().map(|regret| format!("  {:4.1} %", 100.0 * regret)).collect();
        text.push_str(&format!(
            "{:12}      {:.4} {:7.3}        {quantiles}     {:4.1} %\n",
            budget.budget,
            budget.mean_error,
            budget.mean_power_w,
            100.0 * budget.of_means
        ));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_is_summed_up_over_cameras() {
        let camera = |power_w: f64, error: f64, least_w: Option<f64>| CameraRegret {
            position: [0.0; 3],
            rendered: 3,
            budgets: vec![AtCamera {
                budget: 0.02,
                settings: String::new(),
                power_w,
                error,
                least_w,
                least_settings: None,
            }],
        };
        let cameras =
            [camera(6.0, 0.02, Some(5.0)), camera(4.0, 0.01, None), camera(5.0, 0.03, Some(5.0))];
        let of = of_budget(&cameras, 0);
        assert!((of.mean_error - 0.02).abs() < 1e-12 && (of.mean_power_w - 5.0).abs() < 1e-12);
        assert!((of.of_means - 0.1).abs() < 1e-12, "{of:?}");
        assert_eq!(of.searched, 2);
        for (found, expected) in of.quantiles.iter().zip([0.05, 0.1, 0.15, 0.18, 0.2]) {
            assert!((found - expected).abs() < 1e-9, "{of:?}");
        }
        let text = text(&crate::inspect::testing::map(), &cameras, &[of]);
        assert!(text.contains("3 cameras, 9 renderings; searches at 2 of them"), "{text}");
        assert!(text.lines().last().is_some_and(|line| line.contains("10.0 %")), "{text}");
        // Nothing to sum up is no panic.
        assert_eq!(of_budget(&[], 0).searched, 0);
    }
}

//! `frugal price`: cost of each level of the global illumination's knobs, and its error against the
//! path-traced reference.

mod combinations;

use std::path::PathBuf;

use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use frugal_trace::bsdf::Shading;
use frugal_trace::integrator::{Rendering, Settings, Watch, render};
use frugal_trace::metrics::{Difference, Radiance};
use glam::UVec2;

use super::arguments::{
    CameraArguments, check_outputs, check_report, open_scene, size, write, write_report,
};
use super::{CliError, progress};
use crate::report::{LevelPrice, PriceSummary, price_csv, price_report};
use crate::scene::{Environment, LoadedScene};
use crate::stage::{Component, Output, Stage, StageOptions};

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    camera: CameraArguments,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH", default_value = "320x180", value_parser = size)]
    size: UVec2,
    /// Paths per pixel of the reference
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: u32,
    /// Power meter, as `frugal meters` names it; default: the one that suits the adapter
    #[arg(long, value_name = "NAME")]
    meter: Option<String>,
    /// Measures every combination of levels instead, and reports the dominance of levels
    #[arg(long)]
    combinations: bool,
    /// Measures the sky instead: the scene without its punctual lights, and all light of the sky
    /// that at most one surface scatters
    #[arg(long, conflicts_with = "combinations")]
    sky: bool,
    /// Bounces of the reference, and of the global illumination except at lower levels of that
    /// knob: 1 to 3. With more than 1, everything is recomputed in each frame, because further
    /// bounces cost nothing where only the camera moves
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=3), conflicts_with_all = ["combinations", "sky"])]
    bounces: u32,
    /// Table to write
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Folder for a page with the table and a plot
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

/// Frames metered for a reading.
const METERED_FRAMES: u32 = 3;
/// Readings of each setting, interleaved with all others; their median is the cost, so that drift
/// affects all alike.
const ROUNDS: usize = 3;

/// Whether a knob affects bounced light.
fn is_gi(name: &str) -> bool {
    (name.starts_with("gi_") || name.starts_with("rsm_")) && name != SKY
}

/// Whether a knob affects the sky's light.
fn is_sky(name: &str) -> bool {
    [SKY, "gi_visibility", "gi_interleave", "gi_pixel_fraction"].contains(&name)
}

/// The knob of the sky alone.
const SKY: &str = "gi_environment_samples";

/// The knob that changes the target image, not the approximation quality.
const BOUNCES: &str = "gi_bounces";

/// All knobs but the opt-in ones, and [`BOUNCES`].
fn with_bounces() -> Result<Vec<String>, CliError> {
    let names =
        crate::stage::knobs()?.knobs().iter().map(|knob| knob.name.clone()).collect::<Vec<_>>();
    Ok(names.into_iter().chain([BOUNCES.to_owned()]).collect())
}

/// Whether a knob changes neither cost nor image in a static scene.
fn is_still(name: &str) -> bool {
    name == "gi_refresh_period"
}

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    let (mut scene, name) = open_scene(&arguments.camera.scene)?;
    let pose = arguments.camera.pose()?;
    check_outputs([arguments.csv.as_ref()])?;
    check_report(arguments.report.as_ref())?;
    if arguments.sky {
        if matches!(scene.environment, Environment::None) {
            return Err(CliError::usage(format!("--sky: {name} has no environment")));
        }
        scene.description.lights.clear();
    }
    let options = StageOptions {
        size: arguments.size,
        output: Output::Radiance,
        // The sky is shown in full, because Bevy's own environment light replaces it where its
        // samples are off.
        component: if arguments.sky { Component::Full } else { Component::Indirect },
        meter: arguments.meter.clone(),
        knobs: (arguments.bounces > 1).then(with_bounces).transpose()?,
        ..Default::default()
    };
    let mut stage = Stage::open(&scene, options)?;
    let reference = reference(&scene, arguments)?;
    stage.place(pose.position, pose.rotation);
    stage.warm()?;

    let space = stage.space().as_ref().clone();
    let best = match space.index_of(BOUNCES) {
        Some(_) => space
            .parse(&format!("max,{BOUNCES}={}", arguments.bounces))
            .map_err(CliError::failed)?,
        None => space.highest(),
    };
    let off = space.parse("max,gi_vpl_count=0").map_err(CliError::failed)?;
    if arguments.combinations {
        return combinations::run(&mut stage, &reference, off, &name, arguments);
    }
    let priced = levels(&space, best, if arguments.sky { is_sky } else { is_gi });
    let (readings, differences) =
        read_levels(&mut stage, &priced, off, &reference, arguments.bounces)?;
    let power: Vec<f64> = readings.into_iter().map(median).collect();
    let without = power[priced.len()];
    let best =
        priced.iter().position(|level| level.settings == best).map_or(0.0, |index| power[index])
            - without;
    let prices: Vec<LevelPrice> = priced
        .into_iter()
        .zip(power)
        .zip(differences)
        .map(|((level, power), difference)| LevelPrice {
            knob: level.knob,
            label: level.label,
            power_w: power - without,
            cost_share: (power - without) / best,
            difference,
        })
        .collect();

    print_prices(&prices);
    println!(
        "the best costs {best:.3} W of {:.3} W at {} frames per second, {}",
        best + without,
        stage.options().frames_per_second,
        stage.meter().description
    );
    if let Some(path) = &arguments.csv {
        let mut table = Vec::new();
        price_csv(&prices, &mut table).map_err(CliError::failed)?;
        write(path, &table)?;
    }
    if let Some(folder) = &arguments.report {
        let light = match (arguments.sky, arguments.bounces) {
            (true, _) => "light of the sky that one surface scatters".to_owned(),
            (false, 1) => "indirect light of punctual lights, one bounce".to_owned(),
            (false, bounces) => format!("indirect light of punctual lights, {bounces} bounces"),
        };
        let (scene, size, meter) = (name.as_str(), arguments.size.to_array(), &stage.meter());
        let summary =
            PriceSummary { scene, size, prices: &prices, reference: &light, meter, best_w: best };
        write_report(folder, &price_report(&summary)?)?;
    }
    Ok(())
}

/// Reads the power of each level, and of `off` behind them, in several rounds; and the difference
/// of each level's image from the reference.
fn read_levels(
    stage: &mut Stage,
    priced: &[PricedLevel],
    off: KnobLevels,
    reference: &Radiance,
    bounces: u32,
) -> Result<(Vec<Vec<f64>>, Vec<Difference>), CliError> {
    let mut readings = vec![Vec::new(); priced.len() + 1];
    let mut differences = Vec::new();
    let bar = progress::bar((ROUNDS * readings.len()) as u64).with_message("readings");
    for round in 0..ROUNDS {
        for (index, readings) in readings.iter_mut().enumerate() {
            if progress::interrupted() {
                return Err(CliError::failed("interrupted: nothing was written"));
            }
            stage.apply(priced.get(index).map_or(off, |level| level.settings));
            stage.get_ready()?;
            if round == 0 && index < priced.len() {
                differences.push(
                    Difference::new(&stage.radiance()?, reference, None)
                        .map_err(CliError::usage)?,
                );
            }
            if bounces > 1 {
                stage.world_mut().insert_resource(GiRefresh::EveryFrame);
                stage.frame();
            }
            readings.push(stage.metered_frames(METERED_FRAMES)?.0);
            stage.world_mut().insert_resource(GiRefresh::AsIfCamerasMoved);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok((readings, differences))
}

fn print_prices(prices: &[LevelPrice]) {
    println!(
        "{:18} {:>8} {:>10} {:>11} {:>11} {:>12}",
        "knob", "level", "cost", "mean ratio", "relative L1", "of 4x4 means"
    );
    for price in prices {
        let LevelPrice { knob, label, cost_share, difference, .. } = price;
        let Difference { mean_ratio, relative_l1, relative_l1_boxes, .. } = difference;
        println!(
            "{knob:18} {label:>8} {:8.1} % {mean_ratio:11.3} {relative_l1:11.3} {relative_l1_boxes:12.3}",
            100.0 * cost_share
        );
    }
}

/// The reference: bounces between Lambertian surfaces, or sky light that one surface scatters.
fn reference(scene: &LoadedScene, arguments: &Arguments) -> Result<Radiance, CliError> {
    let view = scene.view(arguments.camera.pose()?, arguments.size);
    let samples = arguments.spp;
    let (scene, settings) = if arguments.sky {
        (scene.clone(), Settings { samples, bounces: Some(0), ..Default::default() })
    } else {
        // Environment light bounces in the path tracer and not in the renderer, which is
        // independent of the price of a level.
        let mut punctual_only = scene.clone();
        punctual_only.description.environment = Environment::None;
        (
            punctual_only,
            Settings {
                samples,
                bounces: Some(arguments.bounces),
                shading: Shading::Lambertian,
                ..Default::default()
            },
        )
    };
    let bar = progress::bar(u64::from(arguments.size.y)).with_message("rows of the reference");
    let watch = Watch { row_done: &|| bar.inc(1), interrupted: &progress::interrupted };
    let rendering = render(&scene.reference()?, &view, &settings, watch);
    bar.finish_and_clear();
    let shown =
        |rendering: Rendering| if arguments.sky { rendering.full() } else { rendering.indirect };
    rendering.map(shown).ok_or_else(|| CliError::failed("interrupted: nothing was written"))
}

/// A level of a knob, the others at their best.
struct PricedLevel {
    knob: String,
    label: String,
    settings: KnobLevels,
}

/// All levels with global illumination of the knobs for which `counts` holds, the best first, up to
/// the level in `best`; the other knobs are at `best`.
fn levels(space: &KnobSpace, best: KnobLevels, counts: impl Fn(&str) -> bool) -> Vec<PricedLevel> {
    let mut priced = Vec::new();
    for (index, knob) in space
        .knobs()
        .iter()
        .enumerate()
        .filter(|(_, knob)| counts(&knob.name) && !is_still(&knob.name))
    {
        for (level, described) in knob.levels.iter().enumerate().take(best.level(index) + 1).rev() {
            if knob.name == "gi_vpl_count" && described.value == 0.0 {
                continue;
            }
            let settings = best.with_level(index, level);
            priced.push(PricedLevel {
                knob: knob.name.clone(),
                label: described.label.clone(),
                settings,
            });
        }
    }
    priced
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_with_gi_is_priced_the_best_first() {
        let space = crate::stage::knobs().unwrap();
        let priced = levels(&space, space.highest(), is_gi);
        let count = |name: &str| priced.iter().filter(|level| level.knob == name).count();
        assert_eq!(
            (
                count("gi_vpl_count"),
                count("gi_interleave"),
                count("gi_visibility"),
                count("antialiasing")
            ),
            (7, 3, 3, 0)
        );
        assert_eq!(priced[0].settings, space.highest());
        let space_with_bounces = crate::stage::every_knob()
            .unwrap()
            .subset(with_bounces().unwrap().iter().map(String::as_str))
            .unwrap();
        let two = space_with_bounces.parse("max,gi_bounces=2").unwrap();
        let bounces: Vec<_> = levels(&space_with_bounces, two, is_gi)
            .into_iter()
            .filter(|level| level.knob == BOUNCES)
            .collect();
        assert_eq!(
            bounces.iter().map(|level| level.label.as_str()).collect::<Vec<_>>(),
            ["2", "1"]
        );
        assert_eq!(bounces[0].settings, two);
        let sky = levels(&space, space.highest(), is_sky);
        assert!(sky.iter().any(|level| (level.knob.as_str(), level.label.as_str()) == (SKY, "0")));
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }
}

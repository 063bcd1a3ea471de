//! `frugal calibrate`: prices of work on this device; and `frugal meters`: its power meters.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use bevy_frugal_gi::power;
use bevy_frugal_gi::stage::Meter;
use frugal_core::frontier::WorkPrices;
use frugal_core::units::Watts;
use frugal_search::cameras::CameraSet;
use frugal_search::cost::{CostModel, CostReading, DeviceModel, Work, reading_plan, work_prices};
use frugal_search::pipeline::CLIP_FRAMES;

use super::CliError;
use super::arguments::{CaptureArguments, SceneArguments, check_outputs, duration, write};
use super::input::{open_scene, stage_for};
use super::progress::Progress;
use crate::stage::RemoteStage;
use crate::subject::{camera_space, frame_layout, tracks_of};
use crate::work_meter::WORK_METER;

#[derive(clap::Args, Debug)]
pub(super) struct Arguments {
    #[command(flatten)]
    scene: SceneArguments,
    /// Prices to write
    #[arg(short, long, value_name = "FILE", default_value = "device.prices.ron")]
    output: PathBuf,
    #[command(flatten)]
    capture: CaptureArguments,
    /// Duration of the readings
    #[arg(long, value_name = "TIME", default_value = "2m", value_parser = duration)]
    time_limit: Duration,
    /// Seed of the cameras and settings
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

/// Number of cameras for readings.
const CAMERAS: usize = 6;
/// Fewest readings for a fit of prices.
const FEWEST: usize = 40;

pub(super) fn run(arguments: &Arguments) -> Result<(), CliError> {
    check_outputs([Some(&arguments.output)])?;
    let scene = open_scene(&arguments.scene)?;
    let request = stage_for(&scene, &arguments.capture);
    let mut stage = RemoteStage::open(&scene, request, NonZeroUsize::MIN)?;
    let space = stage.space.clone();
    let fps = arguments.capture.image.fps;
    let tracks = tracks_of(scene.paths.values(), fps);
    let bounds = camera_space(&scene, &tracks);
    let cameras =
        CameraSet::sample(&scene.rays, &bounds, &tracks, [CAMERAS, 0], stage.lens, arguments.seed)
            .training;
    if cameras.is_empty() {
        return Err(CliError::usage(format!(
            "{}: no camera in free space sees the scene: check its bounds",
            scene.label
        )));
    }
    stage.warm()?;
    let layout = frame_layout(&scene, stage.size);
    let limit = arguments.time_limit;
    let shown = Progress::new(limit.as_secs(), "seconds of readings");
    // Measured apart: a fit would share it out among all work that every frame has.
    let idle = stage.idle;
    let started = Instant::now();
    let mut readings = Vec::new();
    for (camera, settings) in reading_plan(&space, cameras.len(), arguments.seed) {
        let cost = stage.processes[0].measure(&cameras[camera].clip(CLIP_FRAMES, fps), settings)?;
        readings.push(CostReading {
            camera,
            work: Work::of(&space, settings, &layout),
            power_w: (cost.power - idle).0.max(0.0),
        });
        let elapsed = started.elapsed();
        let seconds = [elapsed, limit].map(|time| time.as_secs() as usize);
        let going_on = shown.at(seconds[0], seconds[1], "seconds of readings".to_owned());
        // Who interrupts it asks for no file in place of the last, from fewer readings than were asked for.
        if going_on.is_break() {
            return Err(CliError::failed("interrupted: nothing was written"));
        }
        if elapsed >= limit {
            break;
        }
    }
    drop(shown);
    if readings.len() < FEWEST {
        return Err(CliError::failed(format!(
            "{} readings in {:.0} s are too few to fit prices: raise --time-limit, or lower --size",
            readings.len(),
            started.elapsed().as_secs_f64()
        )));
    }
    let error = CostModel::cross_validated(&readings, Watts(0.0));
    let model = CostModel::fit(&readings, Watts(0.0));
    let device = DeviceModel {
        adapter: crate::stage::adapter().map_or_else(|| "none".to_owned(), |adapter| adapter.name),
        meter: stage.meter.clone(),
        mean_absolute_error: error,
        prices: WorkPrices { idle, ..work_prices(&model, &space, &layout, fps) },
    };
    let text = ron::ser::to_string_pretty(&device, ron::ser::PrettyConfig::new())
        .map_err(CliError::failed)?;
    write(&arguments.output, text.as_bytes())?;
    println!(
        "{} readings at {} cameras in {:.0} s, on {}",
        readings.len(),
        cameras.len(),
        started.elapsed().as_secs_f64(),
        device.adapter
    );
    println!(
        "error at held-out readings, of the power beyond the idle device's {:.1} W: {:.1} % in the mean; readings of one frame themselves vary by several percent",
        idle.0,
        100.0 * error
    );
    for (kind, joules) in
        device.prices.kinds.iter().zip(&device.prices.joules).filter(|(_, joules)| **joules > 0.0)
    {
        println!("  {kind:32} {joules:.3e} J");
    }
    Ok(())
}

/// Prints each meter, with its power when idle and under load.
pub(super) fn meters() {
    for (name, usage) in power::meters() {
        println!("{name}   (--meter {usage})");
        let opened = power::open(name).map_err(|error| error.to_string());
        let meter = opened.and_then(|meter| Meter::new(meter).map_err(|error| error.to_string()));
        let mut meter = match meter {
            Ok(meter) => meter,
            Err(error) => {
                println!("  {error}");
                continue;
            }
        };
        println!("  {}: {}", meter.info.provenance, meter.info.description);
        println!("  unit W, window {} s", meter.window_seconds);
        match meter.self_test() {
            Ok(test) => {
                println!("  idle {}, under CPU load {}", test.idle, test.loaded);
                println!(
                    "  {}",
                    if test.responds {
                        "works"
                    } else {
                        "does not respond to a load on the CPU, as a GPU's meter need not, and a battery's is slow"
                    }
                );
            }
            Err(error) => println!("  no reading\n  FAILED: {error}"),
        }
    }
    println!("{WORK_METER}   (--meter {WORK_METER}, {WORK_METER}=FILE; for frugal's own commands)");
    println!(
        "  modelled: the work of each frame at fixed prices; the same in every run, whatever the machine does"
    );
}

//! Gives a map the costs that it has where it is used, and holds it against cameras that it never saw.

use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::{Correction, FrontierMap};

use super::{CliError, progress};
use crate::cells::{Promise, RemeasureConfig, Spread, correction, hold_to_promise, remeasure};
use crate::search::{SubdivisionProgress, Watch};
use crate::stage::RemoteStage;

/// Cameras that the map is held against.
const CAMERAS: u64 = 24;

/// A time limit, and who gets how much of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    started: Instant,
    limit: Option<Duration>,
}

impl Clock {
    /// Share of the limit after which the search ends. More of it finds a few more points; without the rest, what they cost is a guess.
    const SEARCH: f64 = 0.72;

    /// Share of the limit after which measuring in cells ends; the rest is for holding the map to its promise.
    const CELLS: f64 = 0.92;

    pub(super) fn start(limit: Option<Duration>) -> Self {
        Self { started: Instant::now(), limit }
    }

    /// How long the search may take.
    pub(super) fn search(self) -> Option<Duration> {
        self.until(Self::SEARCH)
    }

    fn until(self, share: f64) -> Option<Duration> {
        self.limit.map(|limit| limit.mul_f64(share).saturating_sub(self.started.elapsed()))
    }
}

/// Measures `map`'s costs in its cells, then what remains of their errors. `pace` is the seconds that the search took for a measurement.
pub(super) fn measure_cells(
    stage: &mut RemoteStage,
    map: &mut FrontierMap,
    seed: u64,
    pace: Option<f64>,
    clock: Clock,
) -> Result<(), CliError> {
    let started = Instant::now();
    let searched = map.octree.frontiers.clone();
    let bar = progress::bar(0);
    bar.set_message("measurements where frontiers are used");
    let config = RemeasureConfig { seed, pace, ..Default::default() };
    let mut report = |done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    };
    let mut watch = Watch::start(clock.until(Clock::CELLS), progress::interrupted, |_: &SubdivisionProgress| {});
    let done = remeasure(map, &config, stage, &mut watch, &mut report);
    bar.finish_and_clear();
    let done = done?;
    eprintln!(
        "costs of {} of {} frontiers measured where they are used: {} measurements at {} cameras in {:.0} s",
        done.frontiers,
        map.octree.frontiers.len(),
        done.measurements,
        done.cameras,
        started.elapsed().as_secs_f64()
    );

    let bar = progress::bar(CAMERAS);
    bar.set_message("cameras to check with");
    let mut watch = Watch::start(clock.until(1.0), progress::interrupted, |_: &SubdivisionProgress| {});
    let promises = hold_to_promise(map, &searched, [CAMERAS, seed], stage, &mut watch, &mut |found| bar.set_position(found));
    bar.finish_and_clear();
    let promises = promises?;
    map.correction = correction(&promises);
    if promises.is_empty() {
        eprintln!("the map was held against no other cameras: error budgets are taken as they are");
    } else {
        print_promises(&promises, map.correction);
    }
    Ok(())
}

fn print_promises(promises: &[Promise], Correction { error, samples }: Correction) {
    let searched = promises.iter().filter_map(|promise| Some((promise.searched?, promise.measured)));
    let now = promises.iter().map(|promise| (promise.promised, promise.measured));
    eprintln!("measured ÷ promised of what error budgets pick at {samples} other cameras, median:");
    for (name, [power, error]) in [("as searched", Spread::of(searched)), ("as measured in cells", Spread::of(now))] {
        let text = |spread: Option<Spread>| spread.map_or_else(|| "unknown".to_owned(), |spread| spread.to_string());
        eprintln!("  {name}: power {}, error {}", text(power), text(error));
    }
    eprintln!("error budgets are tightened by the factor {error:.2}");
}

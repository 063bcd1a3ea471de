//! What a frame costs.

use std::time::Instant;

use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::power::{CpuTimeMeter, PowerMeter};
use frugal::stage::{Stage, software_adapter};

use crate::method::Method;

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Processor time of this process, all threads: where the processor renders, all that is spent.
    Cpu,
    /// Time until the frame is finished: where a GPU renders.
    Wall,
}

impl Clock {
    /// The one that suits the adapter.
    pub fn suitable() -> Self {
        if software_adapter() { Self::Cpu } else { Self::Wall }
    }

    /// For a table's header.
    pub fn label(self) -> &'static str {
        match self {
            Self::Cpu => "CPU ms",
            Self::Wall => "wall ms",
        }
    }

    /// Mean milliseconds of so many frames.
    pub fn frames_ms(self, stage: &mut Stage, frames: u32) -> f64 {
        let mut meter = CpuTimeMeter::default();
        let watts = meter.watts_per_core().0;
        let mut cpu_seconds = || meter.energy().unwrap_or_else(|error| panic!("{error}")).0 / watts;
        let (start, cpu_start) = (Instant::now(), cpu_seconds());
        (0..frames).for_each(|_| stage.frame());
        let seconds = match self {
            Self::Cpu => cpu_seconds() - cpu_start,
            Self::Wall => start.elapsed().as_secs_f64(),
        };
        seconds * 1e3 / f64::from(frames)
    }
}

/// What is taken to move in every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// Light or geometry: nothing of the last frame can be kept.
    Everything,
    /// The camera alone: maps rest, those of the baseline too.
    Camera,
}

impl Moving {
    fn policy(self) -> GiRefresh {
        match self {
            Self::Everything => GiRefresh::EveryFrame,
            Self::Camera => GiRefresh::AsIfCamerasMoved,
        }
    }
}

/// How costs are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readings {
    /// Rounds through all methods: a machine that drifts costs all alike. At least 1.
    pub rounds: usize,
    /// Frames of each reading, after those that it takes to get ready. At least 1.
    pub frames: u32,
}

/// Milliseconds that a frame of each method takes above one without global illumination, while so
/// much moves: the median over rounds of differences within a round; and what a frame without it
/// takes.
///
/// Every method must have been ready once, so that nothing is compiled any more.
pub fn above_none(
    stage: &mut Stage,
    methods: &[Method],
    moving: Moving,
    readings: Readings,
) -> (Vec<f64>, f64) {
    let clock = Clock::suitable();
    let read = |stage: &mut Stage, method: &Method| {
        // At rest: where everything moves, averaged light never gets to what a still picture shows,
        // and is waited for in vain.
        stage.world_mut().insert_resource(GiRefresh::OnChange);
        method.apply(stage);
        // Trees of triangles are built in the background when rays are asked for again: their cost
        // is no frame's.
        stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        stage.world_mut().insert_resource(moving.policy());
        stage.frame();
        clock.frames_ms(stage, readings.frames)
    };
    let (mut above, mut none) = (vec![Vec::new(); methods.len()], Vec::new());
    for _ in 0..readings.rounds {
        let without = read(stage, &Method::none());
        none.push(without);
        for (method, above) in methods.iter().zip(&mut above) {
            above.push(read(stage, method) - without);
        }
    }
    (above.into_iter().map(median).collect(), median(none))
}

/// The middle value; of an even number the upper one.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

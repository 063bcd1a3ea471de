//! Cost of a frame.

use std::time::Instant;

use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::power::{CpuTimeMeter, PowerMeter};
use frugal::scene::CameraPath;
use frugal::stage::{Stage, software_adapter};

use crate::method::Method;

/// Frames per second of a walk.
const WALK_FPS: f32 = 60.0;

/// The time that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// CPU time of this process, all threads: the whole cost on a software adapter.
    Cpu,
    /// Time until the frame is finished: for rendering on a GPU.
    Wall,
}

impl Clock {
    /// The clock for the current adapter.
    pub fn suitable() -> Self {
        if software_adapter() { Self::Cpu } else { Self::Wall }
    }

    /// Label for a table's header.
    pub fn label(self) -> &'static str {
        match self {
            Self::Cpu => "CPU ms",
            Self::Wall => "wall ms",
        }
    }

    /// Mean time over `frames` frames, milliseconds per frame.
    pub fn frames_ms(self, stage: &mut Stage, frames: u32) -> f64 {
        self.walk_ms(stage, frames, None)
    }

    /// The same while the camera walks along the first frames of a path, if there is one.
    fn walk_ms(self, stage: &mut Stage, frames: u32, path: Option<&CameraPath>) -> f64 {
        let mut meter = CpuTimeMeter::default();
        let watts = CpuTimeMeter::DEFAULT_WATTS_PER_CORE.0;
        let mut cpu_seconds = || meter.energy().unwrap_or_else(|error| panic!("{error}")).0 / watts;
        let (start, cpu_start) = (Instant::now(), cpu_seconds());
        for number in 1..=frames {
            let pose = path.and_then(|path| path.sample(number as f32 / WALK_FPS));
            if let Some(pose) = pose {
                stage.place(pose.position, pose.rotation);
            }
            stage.frame();
        }
        let seconds = match self {
            Self::Cpu => cpu_seconds() - cpu_start,
            Self::Wall => start.elapsed().as_secs_f64(),
        };
        seconds * 1e3 / f64::from(frames)
    }
}

/// What moves in every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// Lights or geometry: nothing of the last frame can be reused.
    Everything,
    /// The camera only: maps are reused, also by the baseline.
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

/// Repetitions of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readings {
    /// Rounds through all methods, so that drift of the machine affects all of them alike. At least
    /// 1.
    pub rounds: usize,
    /// Frames per reading, after those until the stage is ready. At least 1.
    pub frames: u32,
}

/// Cost per frame of each method above a frame without global illumination, milliseconds: the
/// median over rounds of differences within a round. The second value is the cost of a frame
/// without global illumination. Where only the camera moves, it walks along `path`, if there is one.
///
/// Every method must have been rendered once, so that all pipelines are compiled.
pub fn above_none(
    stage: &mut Stage,
    methods: &[Method],
    moving: Moving,
    readings: Readings,
    path: Option<&CameraPath>,
) -> (Vec<f64>, f64) {
    let clock = Clock::suitable();
    let read = |stage: &mut Stage, method: &Method| {
        // Nothing moves until the stage is ready: while everything moves, temporal accumulation
        // never converges.
        stage.world_mut().insert_resource(GiRefresh::OnChange);
        method.apply(stage);
        // When rays are enabled again, acceleration structures are built in the background: their
        // cost belongs to no frame.
        stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        stage.world_mut().insert_resource(moving.policy());
        stage.frame();
        clock.walk_ms(stage, readings.frames, path.filter(|_| moving == Moving::Camera))
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

/// The given share of the way through `values`, which it sorts.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(share * (values.len() - 1) as f64) as usize]
}

/// Median, 95 % quantile and greatest value.
pub fn spread(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        values.get((share * (values.len().max(1) - 1) as f64).round() as usize).copied()
    };
    [0.5, 0.95, 1.0].map(|share| at(share).unwrap_or(f64::NAN))
}

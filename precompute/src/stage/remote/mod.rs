//! Stages in processes of their own.
//!
//! Software Vulkan drivers recompile a material's shader in every frame that draws several textured
//! materials, and never free the result, even when the device closes. So the command line runs
//! every stage in a process of its own, and replaces one that has grown too large. Its meter then
//! covers the renderer alone, without search, comparison and report.
//!
//! | file | job |
//! |---|---|
//! | `mod` | several processes that render jobs of any order side by side |
//! | `process` | one process, started when it is needed, replaced when it has grown or died |
//! | `program` | a program, its process, and what it said last; its guard |
//! | `connection` | a started program at the other end of a socket |
//! | `staged` | what is rendered: a scene file, or a level of an app |

mod connection;
mod process;
mod program;
mod staged;

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::sync::Arc;

use bevy_frugal_gi::stage::NO_METER;
use bevy_frugal_gi::stage::protocol::Opened;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;
use frugal_search::table::{Batch, Measure, Measured};
use frugal_trace::scene::CameraPose;

use crate::device::on_this_machine;
use crate::stage::{StageError, StageOptions, side_by_side};
use crate::subject::frame_layout;
use crate::work_meter::{WorkMeter, is_work_meter};
pub(crate) use process::Shot;
use process::StageProcess;
pub(crate) use program::{Program, guard};
pub(crate) use staged::StagedScene;

/// A stage in another process, with more of them for what can be rendered side by side.
pub(crate) struct RemoteStage {
    /// At least one.
    pub processes: Vec<StageProcess>,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The knobs on offer.
    pub space: KnobSpace,
    /// The meter's name, provenance and device.
    pub meter: MeterInfo,
    /// Idle power, as far as the meter covers it.
    pub idle: Watts,
    /// Vertical field of view in radians, and width ÷ height.
    pub lens: (f32, f32),
}

impl RemoteStage {
    /// Starts a process with `scene`. Further ones, up to `workers`, start when they are warmed. They
    /// share the processor: a meter that reads the machine reads them all.
    ///
    /// # Errors
    /// When it cannot be started, or its stage cannot be opened.
    pub(crate) fn open(
        scene: &StagedScene,
        mut options: StageOptions,
        workers: NonZeroUsize,
    ) -> Result<Self, StageError> {
        let count = workers.get();
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let threads = (count > 1).then_some((cores / count).max(1));
        let size = options.size.to_array();
        let work = match options.meter.as_deref().and_then(is_work_meter) {
            None => None,
            Some(file) => {
                let meter = WorkMeter::open(file, frame_layout(scene, size));
                Some(Arc::new(meter.map_err(StageError::usage)?))
            }
        };
        if work.is_some() {
            options.meter = Some(NO_METER.to_owned());
        }
        // The first begins with the program that the level came from, where there is one.
        let process = |_| {
            let (program, running) = (scene.program.clone(), scene.take_running());
            StageProcess::new(program, running, options.clone(), work.clone(), threads)
        };
        let mut processes: Vec<_> = (0..count).map(process).collect();
        let Opened { space, meter, idle } = processes[0].start()?;
        let (meter, idle) = match &work {
            Some(work) => (work.info.clone(), work.idle()),
            None => (meter.ok_or_else(|| StageError::usage("the stage has no meter"))?, idle),
        };
        Ok(Self {
            processes,
            size,
            space,
            meter: on_this_machine(meter, crate::stage::adapter()),
            idle,
            lens: (scene.camera.vertical_fov.to_radians(), size[0] as f32 / size[1] as f32),
        })
    }

    /// Renders every level of every knob once, in every process, so that no metered frame compiles.
    ///
    /// # Errors
    /// When a process fails.
    pub(crate) fn warm(&mut self) -> Result<(), StageError> {
        std::thread::scope(|scope| {
            let all = self.processes.iter_mut();
            let threads: Vec<_> = all.map(|process| scope.spawn(|| process.warm())).collect();
            let ended = threads.into_iter().map(|thread| {
                thread.join().unwrap_or_else(|_| Err(StageError::failed("a thread panicked")))
            });
            // All of them, so that none is left to panic unheard.
            ended.collect::<Vec<_>>().into_iter().collect()
        })
    }
}

impl Measure for RemoteStage {
    fn measure_all(
        &mut self,
        batches: &[Batch],
        done: &mut dyn FnMut(Measured) -> ControlFlow<()>,
    ) -> Result<(), String> {
        let batches = split(batches, self.processes.len());
        let mut result = Ok(());
        side_by_side(
            &mut self.processes,
            &batches,
            |process, (batch, clip, settings), tell| {
                settings.iter().try_for_each(|settings| {
                    let cost = process.measure(clip, *settings);
                    let has_failed = cost.is_err();
                    let (batch, settings) = (*batch, *settings);
                    let told = tell(cost.map(|cost| Measured { batch, settings, cost }));
                    if has_failed { ControlFlow::Break(()) } else { told }
                })
            },
            |measured| match measured {
                Ok(measured) => done(measured),
                Err(error) => {
                    result = Err(error.to_string());
                    ControlFlow::Break(())
                }
            },
        );
        result
    }
}

/// The batches in parts, at least `count` where there are as many settings: the number of the batch,
/// its clip, and some of its settings. A part renders the reference at its camera once more.
fn split<'a>(
    batches: &'a [Batch],
    count: usize,
) -> Vec<(usize, &'a [CameraPose], &'a [KnobLevels])> {
    let parts = count.div_ceil(batches.len().max(1));
    let of_batch = |(number, batch): (usize, &'a Batch)| {
        let length = batch.settings.len().div_ceil(parts).max(1);
        let parts = batch.settings.chunks(length);
        parts.map(move |settings| (number, batch.clip.as_slice(), settings))
    };
    batches.iter().enumerate().flat_map(of_batch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_batches_are_split_so_that_every_process_has_some() {
        let batch = |count: u128| Batch {
            clip: Vec::new(),
            settings: (0..count).map(KnobLevels::from_bits).collect(),
        };
        for (counts, processes, expected) in [
            (&[12][..], 4, &[(0, 3), (0, 3), (0, 3), (0, 3)][..]),
            (&[12, 1], 3, &[(0, 6), (0, 6), (1, 1)]),
            (&[2, 3], 2, &[(0, 2), (1, 3)]),
            (&[0, 1], 8, &[(1, 1)]),
            (&[], 2, &[]),
        ] {
            let batches: Vec<Batch> = counts.iter().copied().map(batch).collect();
            let parts = split(&batches, processes);
            let sizes: Vec<_> =
                parts.iter().map(|(number, _, settings)| (*number, settings.len())).collect();
            assert_eq!(sizes, expected, "{counts:?} for {processes}");
        }
    }
}

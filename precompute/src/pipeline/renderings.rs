//! Renderings: asked for in batches, journaled, answered from the journal where they are there, and
//! dealt out to shards.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;

use super::PipelineError;
use crate::cameras::{CameraSet, MovingCamera};
use crate::journal::Journal;
use crate::table::Measure;

/// What a camera is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Purpose {
    /// Searching and fitting.
    Training,
    /// Calibrating error budgets.
    Calibration,
}

impl Purpose {
    const fn letter(self) -> char {
        match self {
            Self::Training => 't',
            Self::Calibration => 'c',
        }
    }
}

/// Settings to render at one camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// What the camera is for.
    pub purpose: Purpose,
    /// Its number among those.
    pub camera: usize,
    /// The settings.
    pub settings: Vec<RenderSettings>,
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// What it is doing.
    pub stage: &'a str,
    /// Renderings of this stage that are done.
    pub done: usize,
    /// Renderings of this stage.
    pub total: usize,
}

type Question = (Purpose, usize, RenderSettings);

/// Everything that was rendered, and what renders more.
pub struct Renderings<'a, M> {
    measure: &'a mut M,
    journal: Journal,
    cameras: &'a CameraSet,
    frames: u32,
    frames_per_second: f64,
    shard: (usize, usize),
    known: HashMap<Question, CostPoint>,
    decisions: HashMap<String, bool>,
    report: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    started: Instant,
    limit: Option<Duration>,
    /// Renderings made in this run, and the seconds they took.
    made: usize,
    seconds: f64,
}

/// What a run of the pipeline is made with.
pub struct Setup<'a, M> {
    /// Renders.
    pub measure: &'a mut M,
    /// Where renderings are kept, and those that were kept before.
    pub journal: (Journal, Vec<String>),
    /// The cameras.
    pub cameras: &'a CameraSet,
    /// Frames of a clip, and their rate.
    pub clip: (u32, f64),
    /// Which part of every batch is rendered here: its number from 0, and how many there are.
    pub shard: (usize, usize),
    /// Ends the search with what was found so far.
    pub limit: Option<Duration>,
    /// Told after every rendering; can stop the run.
    pub report: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
}

impl<'a, M: Measure> Renderings<'a, M> {
    /// Starts the clock.
    pub fn new(setup: Setup<'a, M>) -> Self {
        let Setup {
            measure,
            journal: (journal, records),
            cameras,
            clip: (frames, frames_per_second),
            shard,
            limit,
            report,
        } = setup;
        let mut renderings = Self {
            measure,
            journal,
            cameras,
            frames,
            frames_per_second,
            shard,
            known: HashMap::new(),
            decisions: HashMap::new(),
            report,
            started: Instant::now(),
            limit,
            made: 0,
            seconds: 0.0,
        };
        for record in &records {
            if let Some((question, cost)) = read_rendering(record) {
                renderings.known.insert(question, cost);
            } else if let Some((name, yes)) = read_decision(record) {
                renderings.decisions.insert(name, yes);
            }
        }
        renderings
    }

    /// Renders what is not known yet of `jobs`.
    ///
    /// Every other job is rendered from its last settings to its first, so that what drifts does
    /// not favour some of them. Of a sharded run each shard renders every N-th job; where others'
    /// are missing, the run ends with [`PipelineError::NeedsMerge`].
    ///
    /// # Errors
    /// When rendering fails, the journal cannot be written, or the run is stopped.
    pub fn batch(&mut self, stage: &str, jobs: &[Job]) -> Result<(), PipelineError<M::Error>> {
        let total = jobs.iter().map(|job| job.settings.len()).sum();
        let (mut done, mut is_missing) = (0, false);
        for (number, job) in jobs.iter().enumerate() {
            let is_ours = number % self.shard.1 == self.shard.0;
            let forwards = job.settings.iter();
            let order: Vec<RenderSettings> = if number % 2 == 0 {
                forwards.copied().collect()
            } else {
                forwards.rev().copied().collect()
            };
            for settings in order {
                done += 1;
                let question = (job.purpose, job.camera, settings);
                if self.known.contains_key(&question) {
                    continue;
                } else if !is_ours {
                    is_missing = true;
                    continue;
                }
                self.render(question)?;
                if (self.report)(&Progress { stage, done, total }).is_break() {
                    return Err(PipelineError::Interrupted);
                }
            }
        }
        if is_missing { Err(PipelineError::NeedsMerge) } else { Ok(()) }
    }

    fn render(&mut self, question: Question) -> Result<(), PipelineError<M::Error>> {
        let (purpose, camera, settings) = question;
        let Some(camera) = self.camera(purpose, camera) else { return Ok(()) };
        let clip = camera.clip(self.frames, self.frames_per_second);
        let started = Instant::now();
        let cost = self.measure.measure(&clip, settings).map_err(PipelineError::Measure)?;
        self.seconds += started.elapsed().as_secs_f64();
        self.made += 1;
        self.journal.append(&write_rendering(question, cost))?;
        self.known.insert(question, cost);
        Ok(())
    }

    fn camera(&self, purpose: Purpose, camera: usize) -> Option<&MovingCamera> {
        match purpose {
            Purpose::Training => self.cameras.training.get(camera),
            Purpose::Calibration => self.cameras.calibration.get(camera),
        }
    }

    /// What settings cost at a camera, where that was rendered.
    pub fn get(
        &self,
        purpose: Purpose,
        camera: usize,
        settings: RenderSettings,
    ) -> Option<CostPoint> {
        self.known.get(&(purpose, camera, settings)).copied()
    }

    /// How many renderings are known.
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// A choice that depends on the clock, and so must be the same when the run is resumed: made
    /// once, then remembered.
    ///
    /// # Errors
    /// When the journal cannot be written.
    pub fn decide(
        &mut self,
        name: &str,
        choose: impl FnOnce(&Self) -> bool,
    ) -> Result<bool, PipelineError<M::Error>> {
        if let Some(known) = self.decisions.get(name) {
            return Ok(*known);
        }
        let yes = choose(self);
        self.journal.append(&format!("decide {name} {}", u8::from(yes)))?;
        self.decisions.insert(name.to_owned(), yes);
        Ok(yes)
    }

    /// Whether `more` renderings will probably be done before `share` of the time limit is over.
    /// Always without a limit.
    pub fn has_time(&self, more: usize, share: f64) -> bool {
        let Some(limit) = self.limit else { return true };
        let each = if self.made > 0 { self.seconds / self.made as f64 } else { 0.0 };
        self.started.elapsed().as_secs_f64() + each * more as f64 <= share * limit.as_secs_f64()
    }

    /// Renderings made in this run, and the seconds that they took.
    pub fn effort(&self) -> (usize, f64) {
        (self.made, self.seconds)
    }
}

/// Bit by bit, so that what is read back is what was rendered.
fn write_rendering((purpose, camera, settings): Question, cost: CostPoint) -> String {
    let bits = [cost.power.0, cost.error].map(f64::to_bits);
    format!(
        "render {} {camera:x} {:x} {:016x} {:016x}",
        purpose.letter(),
        settings.bits(),
        bits[0],
        bits[1]
    )
}

fn read_rendering(record: &str) -> Option<(Question, CostPoint)> {
    let mut words = record.strip_prefix("render ")?.split(' ');
    let purpose = match words.next()? {
        "t" => Purpose::Training,
        "c" => Purpose::Calibration,
        _ => return None,
    };
    let mut number = || u64::from_str_radix(words.next()?, 16).ok();
    let (camera, settings) =
        (usize::try_from(number()?).ok()?, RenderSettings::from_bits(number()?));
    Some((
        (purpose, camera, settings),
        CostPoint::new(f64::from_bits(number()?), f64::from_bits(number()?)),
    ))
}

fn read_decision(record: &str) -> Option<(String, bool)> {
    let (name, yes) = record.strip_prefix("decide ")?.rsplit_once(' ')?;
    Some((name.to_owned(), yes == "1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_survive_to_the_last_bit() {
        for cost in [CostPoint::new(0.1 + 0.2, 1e-300), CostPoint::new(f64::INFINITY, -0.0)] {
            let question = (Purpose::Calibration, 77, RenderSettings::from_bits(u64::MAX));
            assert_eq!(read_rendering(&write_rendering(question, cost)), Some((question, cost)));
        }
        assert_eq!(read_decision("decide round 3 1"), Some(("round 3".to_owned(), true)));
        assert_eq!((read_rendering("render x 0 0 0 0"), read_decision("render")), (None, None));
    }
}

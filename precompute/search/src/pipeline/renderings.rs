//! Renderings, requested in batches: journaled, answered from the journal where known, and
//! distributed to shards.

use std::collections::{HashMap, HashSet};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_trace::scene::CameraPose;

use super::PipelineError;
use super::clock::Clock;
use crate::cameras::{CameraSet, MovingCamera};
use crate::journal::{Journal, JournalError};
use crate::table::{Batch, Measure, Measured};
use crate::view_features::ViewFeatures;

/// Purpose of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Purpose {
    /// Searching and fitting.
    Training,
    /// Calibrating error budgets.
    Calibration,
    /// A whole stretch of a track.
    Play,
    /// The end of a stretch, as long as a clip.
    Clip,
    /// Predicting costs; nothing is rendered.
    Unrendered,
}

impl Purpose {
    const fn letter(self) -> char {
        match self {
            Self::Training => 't',
            Self::Calibration => 'c',
            Self::Play => 'p',
            Self::Clip => 'e',
            Self::Unrendered => 'u',
        }
    }

    fn read(word: &str) -> Option<Self> {
        [Self::Training, Self::Calibration, Self::Play, Self::Clip, Self::Unrendered]
            .into_iter()
            .find(|purpose| word.chars().eq([purpose.letter()]))
    }
}

/// Settings to render at one camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Purpose of the camera.
    pub purpose: Purpose,
    /// Its number among the cameras of that purpose, or among the stretches.
    pub camera: usize,
    /// The settings.
    pub settings: Vec<KnobLevels>,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress<'a> {
    /// Name of the stage.
    pub stage: &'a str,
    /// Finished renderings of this stage.
    pub done: usize,
    /// Renderings of this stage.
    pub total: usize,
}

type Question = (Purpose, usize, KnobLevels);

/// All known renderings, and the means to make more.
pub struct Renderings<'a, M> {
    measure: &'a mut M,
    journal: Journal,
    cameras: &'a CameraSet,
    frames: u32,
    frames_per_second: f64,
    shard: (usize, usize),
    known: HashMap<Question, CostPoint>,
    decisions: HashMap<String, bool>,
    proposals: HashMap<String, Vec<KnobLevels>>,
    features: HashMap<(Purpose, usize), ViewFeatures>,
    report: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
    clock: Clock,
    stages: Vec<StageEffort>,
}

/// Effort of one stage of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct StageEffort {
    /// Name of the stage.
    pub stage: String,
    /// Renderings made in this run.
    pub renderings: usize,
    /// Their duration, seconds.
    pub seconds: f64,
}

/// Inputs of a pipeline run.
pub struct Setup<'a, M> {
    /// The renderer.
    pub measure: &'a mut M,
    /// The journal, and its earlier records.
    pub journal: (Journal, Vec<String>),
    /// The cameras.
    pub cameras: &'a CameraSet,
    /// Frames per clip, and frames per second.
    pub clip: (u32, f64),
    /// The shard: its number, from 0, and the number of shards.
    pub shard: (usize, usize),
    /// Time limit, after which the search ends with its results so far.
    pub limit: Option<Duration>,
    /// Called after every rendering; can stop the run.
    pub report: &'a mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
}

impl<'a, M: Measure> Renderings<'a, M> {
    /// Starts the time limit's clock, or continues it where the journal has one.
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
            proposals: HashMap::new(),
            features: HashMap::new(),
            report,
            clock: Clock::start(limit),
            stages: Vec::new(),
        };
        for record in &records {
            if let Some((question, cost)) = read_rendering(record) {
                renderings.known.insert(question, cost);
            } else if let Some((name, yes)) = read_decision(record) {
                renderings.decisions.insert(name, yes);
            } else if let Some((name, settings)) = read_proposal(record) {
                renderings.proposals.insert(name, settings);
            } else if let Some((view, features)) = read_features(record) {
                renderings.features.insert(view, features);
            } else {
                renderings.clock.read(record);
            }
        }
        renderings
    }

    /// Renders the unknown settings of `jobs`.
    ///
    /// Every other job is rendered in reverse order, so that drift does not favour some settings.
    /// In a sharded run each shard renders every N-th job; if jobs of other shards are missing, the
    /// run ends with [`PipelineError::NeedsOthers`].
    ///
    /// # Errors
    /// When rendering fails, the journal cannot be written, or the run is stopped.
    pub fn batch(&mut self, stage: &str, jobs: &[Job]) -> Result<(), PipelineError<M::Error>> {
        let total = jobs.iter().map(|job| job.settings.len()).sum();
        let before = self.effort();
        let result = self.render_all(stage, jobs, total);
        let now = self.effort();
        let (renderings, seconds) = (now.0 - before.0, now.1 - before.1);
        match self.stages.iter_mut().find(|known| known.stage == stage) {
            Some(known) => {
                known.renderings += renderings;
                known.seconds += seconds;
            }
            None => {
                self.stages.push(StageEffort { stage: stage.to_owned(), renderings, seconds });
            }
        }
        result
    }

    fn render_all(
        &mut self,
        stage: &str,
        jobs: &[Job],
        total: usize,
    ) -> Result<(), PipelineError<M::Error>> {
        let (batches, cameras, is_missing) = self.unknown(jobs);
        let unknown: usize = batches.iter().map(|batch| batch.settings.len()).sum();
        let mut done = total.saturating_sub(unknown);
        let mut failure = Ok(());
        let Self { measure, journal, known, report, clock, .. } = self;
        let before = clock.effort().1;
        let started = Instant::now();
        let mut keep = |Measured { batch, settings, cost }: Measured| {
            let (purpose, camera) = cameras[batch];
            let question = (purpose, camera, settings);
            clock.made_one(before + started.elapsed().as_secs_f64());
            done += 1;
            known.insert(question, cost);
            let records = std::iter::once(write_rendering(question, cost)).chain(clock.record());
            if let Err(error) = append(journal, records) {
                failure = Err(error.into());
            } else if report(&Progress { stage, done, total }).is_break() && failure.is_ok() {
                failure = Err(PipelineError::Interrupted);
            }
            if failure.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let measured = measure.measure_all(&batches, &mut keep);
        measured.map_err(PipelineError::Measure)?;
        failure?;
        if is_missing { Err(PipelineError::NeedsOthers) } else { Ok(()) }
    }

    /// What of `jobs` is not known and this shard's to render, the purpose and number of the camera of
    /// each batch, and whether other shards lack anything.
    fn unknown(&self, jobs: &[Job]) -> (Vec<Batch>, Vec<(Purpose, usize)>, bool) {
        let (mut batches, mut cameras, mut is_missing) = (Vec::new(), Vec::new(), false);
        let mut asked = HashSet::new();
        for (number, job) in jobs.iter().enumerate() {
            let clip = self.clip(job.purpose, job.camera);
            let is_unknown = |settings: &&KnobLevels| {
                let question = (job.purpose, job.camera, **settings);
                !clip.is_empty() && !self.known.contains_key(&question) && asked.insert(question)
            };
            let mut settings: Vec<KnobLevels> =
                job.settings.iter().filter(is_unknown).copied().collect();
            if settings.is_empty() {
                continue;
            } else if number % self.shard.1 != self.shard.0 {
                is_missing = true;
                continue;
            }
            if number % 2 == 1 {
                settings.reverse();
            }
            batches.push(Batch { clip, settings });
            cameras.push((job.purpose, job.camera));
        }
        (batches, cameras, is_missing)
    }

    /// The poses to render; none for numbers out of range.
    fn clip(&self, purpose: Purpose, number: usize) -> Vec<CameraPose> {
        let of_camera = |cameras: &[MovingCamera]| {
            cameras
                .get(number)
                .map(|camera| camera.clip(self.frames, self.frames_per_second))
                .unwrap_or_default()
        };
        let stretch = || self.cameras.stretches.get(number).map_or(&[][..], Vec::as_slice);
        match purpose {
            Purpose::Training => of_camera(&self.cameras.training),
            Purpose::Calibration => of_camera(&self.cameras.calibration),
            Purpose::Unrendered => Vec::new(),
            Purpose::Play => stretch().to_vec(),
            Purpose::Clip => {
                let start = stretch().len().saturating_sub(self.frames_per_clip());
                stretch()[start..].to_vec()
            }
        }
    }

    /// Number of stretches of tracks.
    pub fn stretches(&self) -> usize {
        self.cameras.stretches.len()
    }

    /// Number of frames of one rendering.
    pub fn frames(&self, purpose: Purpose, number: usize) -> usize {
        self.clip(purpose, number).len()
    }

    /// Number of frames of a rendering at a camera.
    pub fn frames_per_clip(&self) -> usize {
        self.frames.max(1) as usize
    }

    /// Cost of settings at a camera; `None` where not rendered.
    pub fn get(&self, purpose: Purpose, camera: usize, settings: KnobLevels) -> Option<CostPoint> {
        self.known.get(&(purpose, camera, settings)).copied()
    }

    /// Number of known renderings.
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// A decision that depends on the clock, and so must be the same when the run is resumed: made
    /// once and journaled.
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
        self.keep(format!("decide {name} {}", u8::from(yes)))?;
        self.decisions.insert(name.to_owned(), yes);
        Ok(yes)
    }

    /// Settings that take long to choose, although they follow from the renderings: chosen once and
    /// journaled. A run that is killed every few seconds would otherwise do nothing else.
    ///
    /// # Errors
    /// When the journal cannot be written.
    pub fn settings(
        &mut self,
        name: &str,
        choose: impl FnOnce(&Self) -> Vec<KnobLevels>,
    ) -> Result<Vec<KnobLevels>, PipelineError<M::Error>> {
        if let Some(known) = self.proposals.get(name) {
            return Ok(known.clone());
        }
        let settings = choose(self);
        self.keep(write_proposal(name, &settings))?;
        self.proposals.insert(name.to_owned(), settings.clone());
        Ok(settings)
    }

    /// What a view shows: described once and journaled, for the same reason.
    ///
    /// # Errors
    /// When the journal cannot be written, or the run is stopped.
    pub fn features(
        &mut self,
        purpose: Purpose,
        camera: usize,
        progress: &Progress<'_>,
        describe: impl FnOnce() -> ViewFeatures,
    ) -> Result<ViewFeatures, PipelineError<M::Error>> {
        let view = (purpose, camera);
        if let Some(known) = self.features.get(&view) {
            return Ok(known.clone());
        }
        let features = describe();
        self.keep(write_features(view, &features))?;
        self.features.insert(view, features.clone());
        if (self.report)(progress).is_break() {
            return Err(PipelineError::Interrupted);
        }
        Ok(features)
    }

    /// Appends a record, and what is spent by then.
    fn keep(&mut self, record: String) -> Result<(), JournalError> {
        append(&mut self.journal, std::iter::once(record).chain(self.clock.record()))
    }

    /// Whether there is a time limit.
    pub fn is_limited(&self) -> bool {
        self.clock.is_limited()
    }

    /// Whether `more` renderings will probably finish within `share` of the time limit, by the duration
    /// of those before. Always true without a limit.
    pub fn has_time(&self, more: usize, share: f64) -> bool {
        self.clock.has_time(more, share)
    }

    /// Number of renderings made in this session, and their duration in seconds.
    pub fn effort(&self) -> (usize, f64) {
        self.clock.effort()
    }

    /// The same by stage, in the order of the first batch of each.
    pub fn stages(&self) -> &[StageEffort] {
        &self.stages
    }
}

fn append(
    journal: &mut Journal,
    records: impl Iterator<Item = String>,
) -> Result<(), JournalError> {
    records.into_iter().try_for_each(|record| journal.append(&record))
}

/// Exact bits, so that a record reads back as it was rendered.
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

fn write_proposal(name: &str, settings: &[KnobLevels]) -> String {
    let bits: Vec<String> = settings.iter().map(|one| format!("{:x}", one.bits())).collect();
    format!("settings {name}: {}", bits.join(" "))
}

fn read_proposal(record: &str) -> Option<(String, Vec<KnobLevels>)> {
    let (name, bits) = record.strip_prefix("settings ")?.split_once(':')?;
    let settings = bits
        .split_whitespace()
        .map(|bits| u128::from_str_radix(bits, 16).ok().map(KnobLevels::from_bits));
    Some((name.to_owned(), settings.collect::<Option<_>>()?))
}

fn write_features((purpose, camera): (Purpose, usize), features: &[f64]) -> String {
    let bits: Vec<String> = features.iter().map(|one| format!("{:016x}", one.to_bits())).collect();
    format!("view {} {camera:x} {}", purpose.letter(), bits.join(" "))
}

fn read_features(record: &str) -> Option<((Purpose, usize), ViewFeatures)> {
    let mut words = record.strip_prefix("view ")?.split_whitespace();
    let purpose = Purpose::read(words.next()?)?;
    let camera = usize::from_str_radix(words.next()?, 16).ok()?;
    let numbers = words.map(|bits| u64::from_str_radix(bits, 16).ok().map(f64::from_bits));
    Some(((purpose, camera), numbers.collect::<Option<_>>()?))
}

fn read_rendering(record: &str) -> Option<(Question, CostPoint)> {
    let mut words = record.strip_prefix("render ")?.split(' ');
    let purpose = Purpose::read(words.next()?)?;
    let camera = usize::from_str_radix(words.next()?, 16).ok()?;
    let settings = KnobLevels::from_bits(u128::from_str_radix(words.next()?, 16).ok()?);
    let mut number = || u64::from_str_radix(words.next()?, 16).ok();
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
            let question = (Purpose::Calibration, 77, KnobLevels::from_bits(u128::MAX));
            assert_eq!(read_rendering(&write_rendering(question, cost)), Some((question, cost)));
        }
        assert_eq!(read_decision("decide round 3 1"), Some(("round 3".to_owned(), true)));
        for settings in [vec![], vec![KnobLevels::from_bits(0x1f), KnobLevels::from_bits(0)]] {
            let record = write_proposal("round 2", &settings);
            assert_eq!(read_proposal(&record), Some(("round 2".to_owned(), settings)));
        }
        assert_eq!(read_proposal("settings round 2: 1f x"), None);
        for features in [vec![], vec![0.1 + 0.2, -0.0, f64::INFINITY]] {
            let view = (Purpose::Unrendered, 0x2a);
            assert_eq!(read_features(&write_features(view, &features)), Some((view, features)));
        }
        assert_eq!((read_features("view u 1 x"), read_features("view x 1 0")), (None, None));
        assert_eq!((read_rendering("render x 0 0 0 0"), read_decision("render")), (None, None));
    }
}

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
use crate::cameras::CameraSet;
use crate::journal::{Journal, JournalError, cost_record, read_cost};
use crate::table::{Batch, Measure, Measured};

/// Purpose of a camera; its letter in the journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Purpose {
    /// Searching and fitting.
    Training = b't',
    /// Calibrating error budgets.
    Calibration = b'c',
}

/// Settings to render at one camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Job {
    /// Purpose of the camera, and its number among the cameras of that purpose.
    pub camera: (Purpose, usize),
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

/// Inputs of a pipeline run.
pub struct Setup<'a> {
    /// The renderer.
    pub measure: &'a mut dyn Measure,
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

/// All known renderings, and the means to make more.
pub(super) struct Renderings<'a> {
    /// Its inputs; the journal with the records of earlier runs, and what [`once`](Self::once) added.
    pub setup: Setup<'a>,
    /// Costs by [`question`].
    pub known: HashMap<String, CostPoint>,
    /// The time limit's clock.
    pub clock: Clock,
}

impl<'a> Renderings<'a> {
    /// Starts the time limit's clock, or continues it where the journal has one.
    pub(super) fn new(setup: Setup<'a>) -> Self {
        let records = &setup.journal.1;
        let costs = records.iter().filter_map(|record| read_cost(record));
        let known = costs.filter(|(question, _)| question.starts_with("render "));
        let known = known.map(|(question, cost)| (question.to_owned(), cost)).collect();
        Self { known, clock: Clock::start(setup.limit, records), setup }
    }

    /// Renders the unknown settings of `jobs`.
    ///
    /// Every other job is rendered in reverse order, so that drift does not favour some settings.
    /// In a sharded run each shard renders every N-th job; if jobs of other shards are missing, the
    /// run ends with [`PipelineError::NeedsOthers`].
    ///
    /// # Errors
    /// When rendering fails, the journal cannot be written, or the run is stopped.
    pub(super) fn batch(&mut self, stage: &str, jobs: &[Job]) -> Result<(), PipelineError> {
        let (batches, cameras, is_missing) = self.unknown(jobs);
        let total: usize = jobs.iter().map(|job| job.settings.len()).sum();
        let unknown: usize = batches.iter().map(|batch| batch.settings.len()).sum();
        let mut done = total.saturating_sub(unknown);
        let mut failure = Ok(());
        let Self { setup: Setup { measure, journal: (journal, _), report, .. }, known, clock } =
            self;
        let before = clock.seconds;
        let started = Instant::now();
        let mut keep = |Measured { batch, settings, cost }: Measured| {
            clock.made += 1;
            clock.seconds = before + started.elapsed().as_secs_f64();
            done += 1;
            let question = question(cameras[batch], settings);
            let record = cost_record(&question, cost);
            known.insert(question, cost);
            if let Err(error) = append(journal, &record, clock) {
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

    /// What of `jobs` is not known and this shard's to render, the camera of each batch, and whether
    /// other shards lack anything.
    fn unknown(&self, jobs: &[Job]) -> (Vec<Batch>, Vec<(Purpose, usize)>, bool) {
        let (mut batches, mut cameras, mut is_missing) = (Vec::new(), Vec::new(), false);
        let (shard, shards) = self.setup.shard;
        let mut asked = HashSet::new();
        for (number, Job { camera, settings }) in jobs.iter().enumerate() {
            let is_unknown = |settings: &&KnobLevels| {
                let question = question(*camera, **settings);
                !self.known.contains_key(&question) && asked.insert(question)
            };
            let mut settings: Vec<KnobLevels> =
                settings.iter().filter(is_unknown).copied().collect();
            if settings.is_empty() {
                continue;
            } else if number % shards != shard {
                is_missing = true;
                continue;
            }
            if number % 2 == 1 {
                settings.reverse();
            }
            batches.push(Batch { clip: self.clip(*camera), settings });
            cameras.push(*camera);
        }
        (batches, cameras, is_missing)
    }

    /// The poses to render.
    fn clip(&self, (purpose, number): (Purpose, usize)) -> Vec<CameraPose> {
        let Setup { cameras, clip: (frames, frames_per_second), .. } = self.setup;
        let cameras = match purpose {
            Purpose::Training => &cameras.training,
            Purpose::Calibration => &cameras.calibration,
        };
        cameras[number].clip(frames, frames_per_second)
    }

    /// Cost of settings at a camera; `None` where not rendered.
    pub(super) fn get(&self, camera: (Purpose, usize), settings: KnobLevels) -> Option<CostPoint> {
        self.known.get(&question(camera, settings)).copied()
    }

    /// Whether `more` renderings will probably finish within `share` of the time limit. A resumed run
    /// must decide the same: decided once by `name`, and journaled.
    ///
    /// # Errors
    /// When the journal cannot be written.
    pub(super) fn has_time(
        &mut self,
        name: &str,
        more: usize,
        share: f64,
    ) -> Result<bool, JournalError> {
        let write = |yes: &bool| u8::from(*yes).to_string();
        self.once(
            &format!("decide {name} "),
            |word| Some(word == "1"),
            write,
            |it| it.clock.has_time(more, share),
        )
    }

    /// Settings that take long to choose, although they follow from the renderings: chosen once and
    /// journaled. A run that is killed every few seconds would otherwise do nothing else.
    ///
    /// # Errors
    /// When the journal cannot be written.
    pub(super) fn settings(
        &mut self,
        name: &str,
        choose: impl FnOnce(&Self) -> Vec<KnobLevels>,
    ) -> Result<Vec<KnobLevels>, JournalError> {
        self.once(
            &format!("settings {name}: "),
            read_settings,
            |all: &Vec<_>| write_settings(all),
            choose,
        )
    }

    /// What the last record after `key` says; what is made instead is journaled.
    fn once<T>(
        &mut self,
        key: &str,
        read: impl Fn(&str) -> Option<T>,
        write: impl Fn(&T) -> String,
        make: impl FnOnce(&Self) -> T,
    ) -> Result<T, JournalError> {
        let records = self.setup.journal.1.iter().rev();
        if let Some(known) = records.filter_map(|record| record.strip_prefix(key)).find_map(read) {
            return Ok(known);
        }
        let made = make(self);
        let record = format!("{key}{}", write(&made));
        append(&mut self.setup.journal.0, &record, &self.clock)?;
        self.setup.journal.1.push(record);
        Ok(made)
    }
}

/// Appends a record, and what is spent by then.
fn append(journal: &mut Journal, record: &str, clock: &Clock) -> Result<(), JournalError> {
    journal.append(record)?;
    clock.record().map_or(Ok(()), |spent| journal.append(&spent))
}

/// How the record of a rendering begins.
fn question((purpose, camera): (Purpose, usize), settings: KnobLevels) -> String {
    format!("render {} {camera:x} {:x}", purpose as u8 as char, settings.bits())
}

fn write_settings(settings: &[KnobLevels]) -> String {
    settings.iter().map(|one| format!("{:x}", one.bits())).collect::<Vec<_>>().join(" ")
}

fn read_settings(words: &str) -> Option<Vec<KnobLevels>> {
    let bits = |word| Some(KnobLevels::from_bits(u128::from_str_radix(word, 16).ok()?));
    words.split_whitespace().map(bits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_survive_to_the_last_bit() {
        for cost in [CostPoint::new(0.1 + 0.2, 1e-300), CostPoint::new(f64::INFINITY, -0.0)] {
            let asked = question((Purpose::Calibration, 77), KnobLevels::from_bits(u128::MAX));
            assert_eq!(asked, format!("render c 4d {:x}", u128::MAX));
            assert_eq!(read_cost(&cost_record(&asked, cost)), Some((asked.as_str(), cost)));
        }
        for settings in [vec![], vec![KnobLevels::from_bits(0x1f), KnobLevels::from_bits(0)]] {
            assert_eq!(read_settings(&write_settings(&settings)), Some(settings));
        }
        assert_eq!(read_settings("1f x"), None);
        assert_eq!((read_cost("render t 0 0 x 0"), read_cost("decide")), (None, None));
    }
}

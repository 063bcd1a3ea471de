//! The append-only journal of a run: what was evaluated is never evaluated again, whatever killed the run.
//!
//! Text, a line each: a header that says what the figures belong to, and a record per answer with its numbers bit by bit. Every line ends in a
//! checksum over the whole file up to there, so that torn, changed and missing lines are found alike; a journal is read up to the first bad line,
//! and the rest is cut off. The search is deterministic, so a resumed run asks the same questions again and is answered from here until it is where
//! it was.

use std::collections::HashMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;
use serde::{Deserialize, Serialize};

use super::record::{Answer, Checksum, MAGIC, Question, checked, header_text, line, read, write};
use super::{Evaluate, SampleCamera};

/// Records reach the operating system at once, and the disk at most this much later: a kill loses nothing, a power cut a second.
const SYNC: Duration = Duration::from_secs(1);

/// What the figures of a journal belong to: a run with another header may not use them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JournalHeader {
    /// Fingerprint of the scene: its description and every file that it names.
    pub scene: String,
    /// [`knob_space_hash`](super::knob_space_hash) of the knobs.
    pub knob_space: u64,
    /// How pictures are taken: size, rate, adapter, and whatever else changes them.
    pub capture: String,
    /// Name of the power meter.
    pub meter: String,
    /// The search's seed.
    pub seed: u64,
}

impl JournalHeader {
    /// Name and both values of the first field in which two headers differ.
    fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let fields = |header: &Self| {
            let Self { scene, knob_space, capture, meter, seed } = header.clone();
            [("scene", scene), ("knobs", format!("{knob_space:016x}")), ("capture", capture), ("meter", meter), ("seed", seed.to_string())]
        };
        let mut pairs = fields(self).into_iter().zip(fields(other));
        pairs.find_map(|((name, here), (_, there))| (here != there).then_some((name, here, there)))
    }
}

/// Why there is no journal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The file system refused.
    #[error("cannot {action} the journal `{path}`: {source}; make room or give it another place", path = path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// The journal.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file is something else, or its first line is damaged.
    #[error("`{path}` is not a journal of this version: move it away, or run without --resume to start anew", path = path.display())]
    NotAJournal {
        /// The file.
        path: PathBuf,
    },
    /// The journal belongs to another run.
    #[error(
        "the journal `{path}` is of another run: its {field} is `{found}`, here it is `{expected}`; resume with the same, or run without --resume to start anew",
        path = path.display()
    )]
    OtherRun {
        /// The journal.
        path: PathBuf,
        /// What differs.
        field: &'static str,
        /// What the journal has.
        found: String,
        /// What this run has.
        expected: String,
    },
    /// Another process is at it.
    #[error("the journal `{path}` is in use: wait for the other run, or give this one another output", path = path.display())]
    InUse {
        /// The journal.
        path: PathBuf,
    },
    /// The header cannot be written as text.
    #[error("the journal's header cannot be written: {0}")]
    Header(#[from] serde_json::Error),
}

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    checksum: Checksum,
    answers: HashMap<Question, Answer>,
    synced: Instant,
}

impl Journal {
    /// Starts a journal at `path`, over whatever is there.
    ///
    /// # Errors
    /// When the file cannot be written, or another run has it open.
    pub fn create(path: &Path, header: &JournalHeader) -> Result<Self, JournalError> {
        let mut journal = Self::open(path)?;
        journal.start(header)?;
        Ok(journal)
    }

    /// Continues the journal at `path`, up to its first bad line; starts one where there is none.
    ///
    /// # Errors
    /// When the file cannot be read and written, is not a journal, belongs to a run with another header, or another run has it open.
    pub fn resume(path: &Path, header: &JournalHeader) -> Result<Self, JournalError> {
        let mut journal = Self::open(path)?;
        let mut bytes = Vec::new();
        journal.file.read_to_end(&mut bytes).map_err(|source| journal.failed("read", source))?;
        let (first, _) = line(&header_text(header)?, Checksum::START);
        // Killed before the first line was whole: nothing is lost.
        if bytes.len() < first.len() && first.as_bytes().starts_with(&bytes) {
            journal.start(header)?;
            return Ok(journal);
        }
        let mut lines = whole_lines(&bytes);
        let (found, checksum) = lines.next().and_then(read_header).ok_or_else(|| JournalError::NotAJournal { path: path.to_owned() })?;
        if let Some((field, found, expected)) = found.difference(header) {
            return Err(JournalError::OtherRun { path: path.to_owned(), field, found, expected });
        }
        journal.checksum = checksum;
        let mut end = bytes.iter().position(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        for text in lines {
            let Some((text, checksum)) = std::str::from_utf8(text).ok().and_then(|text| checked(text, journal.checksum)) else { break };
            let Some((question, answer)) = read(text) else { break };
            journal.answers.insert(question, answer);
            journal.checksum = checksum;
            end += text.len() + CHECKSUM_BYTES;
        }
        journal.file.set_len(end as u64).map_err(|source| journal.failed("shorten", source))?;
        journal.file.seek(SeekFrom::Start(end as u64)).map_err(|source| journal.failed("read", source))?;
        Ok(journal)
    }

    /// How many answers it holds.
    pub fn len(&self) -> usize {
        self.answers.len()
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.answers.is_empty()
    }

    fn open(path: &Path) -> Result<Self, JournalError> {
        let failed = |source| JournalError::File { action: "open", path: path.to_owned(), source };
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        match file.try_lock() {
            // Some file systems have no locks; the run is then as safe as its user is careful.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => return Err(JournalError::InUse { path: path.to_owned() }),
        }
        Ok(Self { path: path.to_owned(), file, checksum: Checksum::START, answers: HashMap::new(), synced: Instant::now() })
    }

    fn start(&mut self, header: &JournalHeader) -> Result<(), JournalError> {
        let text = header_text(header)?;
        self.file.set_len(0).and_then(|()| self.file.rewind()).map_err(|source| self.failed("empty", source))?;
        self.append(&text)
    }

    fn record(&mut self, question: Question, answer: Answer) -> Result<(), JournalError> {
        self.append(&write(question, answer))?;
        self.answers.insert(question, answer);
        Ok(())
    }

    fn append(&mut self, text: &str) -> Result<(), JournalError> {
        let (whole, checksum) = line(text, self.checksum);
        // One write, so that a kill leaves a whole line or a torn one, never two halves.
        self.file.write_all(whole.as_bytes()).map_err(|source| self.failed("write", source))?;
        self.checksum = checksum;
        if self.synced.elapsed() >= SYNC {
            self.file.sync_data().map_err(|source| self.failed("write", source))?;
            self.synced = Instant::now();
        }
        Ok(())
    }

    fn failed(&self, action: &'static str, source: io::Error) -> JournalError {
        JournalError::File { action, path: self.path.clone(), source }
    }
}

/// Space, checksum and line end, which follow a line's text.
const CHECKSUM_BYTES: usize = 1 + 16 + 1;

/// Lines that have an end, without it.
fn whole_lines(bytes: &[u8]) -> impl Iterator<Item = &[u8]> {
    bytes.split_inclusive(|byte| *byte == b'\n').filter_map(|line| line.strip_suffix(b"\n"))
}

fn read_header(line: &[u8]) -> Option<(JournalHeader, Checksum)> {
    let (text, checksum) = checked(std::str::from_utf8(line).ok()?, Checksum::START)?;
    let header = text.strip_prefix(MAGIC)?.strip_prefix(' ')?;
    Some((serde_json::from_str(header).ok()?, checksum))
}

/// Why a journaled evaluator has no answer.
#[derive(Debug, thiserror::Error)]
pub enum JournaledError<E> {
    /// The answer could not be recorded.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The inner evaluator failed.
    #[error("{0}")]
    Evaluate(E),
}

/// An evaluator that answers from a journal what is recorded there, and records what is not.
#[derive(Debug)]
pub struct Journaled<E> {
    inner: E,
    journal: Journal,
    replayed: usize,
}

impl<E: Evaluate> Journaled<E> {
    /// Records `inner`'s answers in `journal`.
    pub fn new(inner: E, journal: Journal) -> Self {
        Self { inner, journal, replayed: 0 }
    }

    /// How many answers came from the journal so far.
    pub fn replayed(&self) -> usize {
        self.replayed
    }

    /// The evaluator, the journal closed.
    pub fn into_inner(self) -> E {
        self.inner
    }

    fn answer<A>(
        &mut self,
        question: Question,
        ask: impl FnOnce(&mut E) -> Result<A, E::Error>,
        store: impl FnOnce(&A) -> Answer,
        restore: impl FnOnce(Answer) -> A,
    ) -> Result<A, JournaledError<E::Error>> {
        if let Some(answer) = self.journal.answers.get(&question) {
            self.replayed += 1;
            return Ok(restore(*answer));
        }
        let answer = ask(&mut self.inner).map_err(JournaledError::Evaluate)?;
        self.journal.record(question, store(&answer))?;
        Ok(answer)
    }
}

impl<E: Evaluate> Evaluate for Journaled<E> {
    type Error = JournaledError<E::Error>;

    /// Not recorded, since it costs next to nothing.
    fn sees(&mut self, camera: SampleCamera) -> Result<bool, Self::Error> {
        self.inner.sees(camera).map_err(JournaledError::Evaluate)
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, Self::Error> {
        let ask = |inner: &mut E| inner.evaluate(camera, settings);
        self.answer(Question::evaluate(camera, settings), ask, |cost| (*cost).into(), Answer::cost)
    }

    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, Self::Error> {
        let ask = |inner: &mut E| inner.refine(camera, settings, so_far);
        self.answer(Question::refine(camera, settings), ask, |cost| (*cost).into(), Answer::cost)
    }

    fn allowance(&mut self, camera: SampleCamera, proposed: usize) -> Result<usize, Self::Error> {
        let ask = |inner: &mut E| inner.allowance(camera, proposed);
        let restore = |answer: Answer| usize::try_from(answer.0[0]).unwrap_or(usize::MAX);
        self.answer(Question::Allow(camera.key()), ask, |allowance| Answer([*allowance as u64, 0]), restore)
    }
}

#[cfg(test)]
mod tests;

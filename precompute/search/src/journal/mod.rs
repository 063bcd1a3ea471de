//! The append-only journal of a run: no rendering is repeated after the run was killed.
//!
//! A text file: a header line that identifies scene and conditions, then one record per line, each
//! with a checksum, which detects torn and changed lines. These are left out. The pipeline is
//! deterministic: a resumed run makes the same requests, and the journal answers what it knows. A run
//! writes its own journal and may read others of the same run, such as those of other shards.

mod contents;
mod error;
#[cfg(test)]
mod tests;

use std::collections::HashSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::files::FileError;

pub use contents::hash;
use contents::{Contents, MAGIC, is_of_us, is_unbegun, line};
pub use error::JournalError;

/// Greatest delay before records reach the disk; they reach the operating system at once. A kill
/// loses nothing, a power cut a second.
const SYNC: Duration = Duration::from_secs(1);

/// What to do with a journal that holds records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Continue it, if it is of the same run.
    Resume,
    /// Empty it, of whatever run it is.
    Overwrite,
    /// Leave it as it is: an error.
    Refuse,
}

/// Identifies scene and conditions of a journal's records: names and values, the most significant
/// first. A run with another header must not use them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JournalHeader(Vec<(String, String)>);

impl JournalHeader {
    /// The header with one more field.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.0.push((name.to_owned(), value.to_string()));
        self
    }

    fn value(&self, name: &str) -> Option<&String> {
        self.0.iter().rev().find(|(other, _)| other == name).map(|(_, value)| value)
    }

    /// Name and both values of the first field in which this header differs from another.
    fn difference(&self, other: &Self) -> Option<(String, String, String)> {
        let differs = other.0.iter().find_map(|(name, value)| {
            let own = self.value(name);
            let text = own.map_or("nothing", String::as_str).to_owned();
            (own != Some(value)).then(|| (name.clone(), text, value.clone()))
        });
        differs.or_else(|| {
            let (name, value) = self.0.iter().find(|(name, _)| other.value(name).is_none())?;
            Some((name.clone(), value.clone(), "nothing".to_owned()))
        })
    }

    fn text(&self) -> Result<String, JournalError> {
        Ok(format!("{MAGIC} {}", serde_json::to_string(&self.0)?))
    }

    fn read(text: &str) -> Option<Self> {
        let fields = text.strip_prefix(MAGIC)?.strip_prefix(' ')?;
        Some(Self(serde_json::from_str(fields).ok()?))
    }
}

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    synced: Instant,
    damaged: usize,
}

impl Journal {
    /// Opens the journal at `path` for the run of `header`; starts one if there is none, or if the one
    /// that is there holds no records. Returns its records in the order of writing.
    ///
    /// # Errors
    /// When the file cannot be read and written, is not a journal, another process has it open, or it
    /// holds records and `existing` does not allow their use.
    pub fn open(
        path: &Path,
        header: &JournalHeader,
        existing: Existing,
    ) -> Result<(Self, Vec<String>), JournalError> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let (file, bytes) = locked(path, &options, "open")?;
        let mut journal = Self { path: path.to_owned(), file, synced: Instant::now(), damaged: 0 };
        let Some(contents) = admitted(path, &bytes, existing, header)? else {
            journal.start(header)?;
            return Ok((journal, Vec::new()));
        };
        journal.damaged = contents.damaged;
        let end = contents.end as u64;
        journal.file.set_len(end).map_err(|source| journal.failed("shorten", source))?;
        journal.file.seek(SeekFrom::Start(end)).map_err(|source| journal.failed("read", source))?;
        Ok((journal, contents.records))
    }

    /// Complete lines that were left out, because they are damaged.
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    fn start(&mut self, header: &JournalHeader) -> Result<(), JournalError> {
        let text = header.text()?;
        self.file
            .set_len(0)
            .and_then(|()| self.file.rewind())
            .map_err(|source| self.failed("empty", source))?;
        self.append(&text)
    }

    /// Adds a record: text without line breaks.
    ///
    /// # Errors
    /// When the file cannot be written. Earlier records stay readable.
    pub fn append(&mut self, record: &str) -> Result<(), JournalError> {
        debug_assert!(!record.contains('\n'), "a record is one line");
        // One write, so that a kill leaves a whole line or a torn one, never two halves.
        self.file
            .write_all(line(record).as_bytes())
            .map_err(|source| self.failed("write", source))?;
        if self.synced.elapsed() >= SYNC {
            self.file.sync_data().map_err(|source| self.failed("write", source))?;
            self.synced = Instant::now();
        }
        Ok(())
    }

    fn failed(&self, action: &'static str, source: io::Error) -> JournalError {
        FileError::new(action, &self.path, source).into()
    }
}

/// What a file holds that is to be continued; `None` where it is to be begun.
fn admitted(
    path: &Path,
    bytes: &[u8],
    existing: Existing,
    header: &JournalHeader,
) -> Result<Option<Contents>, JournalError> {
    if is_unbegun(bytes) || existing == Existing::Overwrite && is_of_us(bytes) {
        return Ok(None);
    }
    let path = path.to_owned();
    let Some(contents) = Contents::read(bytes) else {
        return Err(JournalError::NotAJournal { path });
    };
    if contents.is_empty() {
        return Ok(None);
    }
    if let Some((field, found, expected)) = contents.header.difference(header) {
        return Err(JournalError::OtherRun { path, field, found, expected });
    }
    if existing == Existing::Refuse {
        let records = contents.records.len() + contents.damaged;
        return Err(JournalError::HasRecords { path, records });
    }
    Ok(Some(contents))
}

/// Opens and locks the file at `path` for an `action`; returns it with what it holds. Some file
/// systems have no locks; there nobody can tell whether it is in use.
fn locked(
    path: &Path,
    options: &OpenOptions,
    action: &'static str,
) -> Result<(File, Vec<u8>), JournalError> {
    let failed = |source| FileError::new(action, path, source);
    let mut file = options.open(path).map_err(failed)?;
    if let Err(TryLockError::WouldBlock) = file.try_lock() {
        return Err(JournalError::InUse { path: path.to_owned() });
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(failed)?;
    Ok((file, bytes))
}

/// Reads a journal, which a run may be writing: its header and its valid records.
///
/// # Errors
/// When the file cannot be read or is not a journal.
pub fn read_journal(path: &Path) -> Result<(JournalHeader, Vec<String>), JournalError> {
    let bytes = std::fs::read(path).map_err(|source| FileError::new("read", path, source))?;
    let contents = Contents::read(&bytes)
        .ok_or_else(|| JournalError::NotAJournal { path: path.to_owned() })?;
    Ok((contents.header, contents.records))
}

/// The records of a journal of the run of `header`, which another process may be writing.
///
/// # Errors
/// When the file cannot be read, is not a journal, or is of another run.
pub fn records_of(path: &Path, header: &JournalHeader) -> Result<Vec<String>, JournalError> {
    let (found, records) = read_journal(path)?;
    match found.difference(header) {
        None => Ok(records),
        Some((field, found, expected)) => {
            Err(JournalError::OtherRun { path: path.to_owned(), field, found, expected })
        }
    }
}

/// Adds the records of `files`, journals of one run, to the journal at `output`, each once; makes it
/// where there is none. Returns the number of its records.
///
/// # Errors
/// When a file cannot be read, is not a journal, or belongs to another run than the first, or when
/// `output` is in use or holds anything else; nothing is written then.
pub fn merge_journals(files: &[PathBuf], output: &Path) -> Result<usize, JournalError> {
    let mut header = None;
    let mut all = Vec::new();
    for file in files {
        let (found, _) = read_journal(file)?;
        all.extend(records_of(file, header.get_or_insert(found))?);
    }
    let header = header.unwrap_or_default();
    let (mut journal, records) = Journal::open(output, &header, Existing::Resume)?;
    let mut seen: HashSet<String> = records.into_iter().collect();
    for record in all {
        if !seen.contains(&record) {
            journal.append(&record)?;
            seen.insert(record);
        }
    }
    Ok(seen.len())
}

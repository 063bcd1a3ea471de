//! The append-only journal of a run: no rendering is repeated after the run was killed.
//!
//! A text file: a header line that identifies scene and conditions, then one record per line. Every
//! line ends in a checksum over the whole file up to it, which detects torn, changed and missing
//! lines. A journal is read up to its first invalid line, and truncated there. The pipeline is
//! deterministic: a resumed run makes the same requests, and the journal answers them up to the
//! point of interruption.

mod contents;
mod error;
mod line;
mod merge;
#[cfg(test)]
mod tests;

use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use contents::{Contents, Locked, is_of_us, is_unbegun};
pub(crate) use error::JournalError;
pub(crate) use line::hash;
use line::{Checksum, line};
pub(crate) use merge::merge_journals;

use crate::files::FileError;

/// Greatest delay before records reach the disk; they reach the operating system at once. A kill
/// loses nothing, a power cut a second.
const SYNC: Duration = Duration::from_secs(1);

/// First word of a journal, with the version of its format: of its lines, and of what is counted in
/// them.
const MAGIC: &str = "frugal-journal 3";

/// What to do with a journal that holds records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Existing {
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
pub(crate) struct JournalHeader(Vec<(String, String)>);

impl JournalHeader {
    /// The header with one more field.
    #[must_use]
    pub(crate) fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.0.push((name.to_owned(), value.to_string()));
        self
    }

    fn value(&self, name: &str) -> Option<&String> {
        self.0.iter().rev().find(|(other, _)| other == name).map(|(_, value)| value)
    }

    /// Name and both values of the first field in which this header differs from another.
    fn difference(&self, other: &Self) -> Option<(String, String, String)> {
        self.contradiction(other).or_else(|| {
            let (name, value) = self.0.iter().find(|(name, _)| other.value(name).is_none())?;
            Some((name.clone(), value.clone(), "nothing".to_owned()))
        })
    }

    /// The same for the fields that `known`, a part of a header, has.
    fn contradiction(&self, known: &Self) -> Option<(String, String, String)> {
        known.0.iter().find_map(|(name, value)| {
            let own = self.value(name);
            let text = own.map_or("nothing", String::as_str).to_owned();
            (own != Some(value)).then(|| (name.clone(), text, value.clone()))
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
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    checksum: Checksum,
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
    pub(crate) fn open(
        path: &Path,
        header: &JournalHeader,
        existing: Existing,
    ) -> Result<(Self, Vec<String>), JournalError> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let Locked { file, bytes, .. } = Locked::open(path, &options, "open")?;
        let mut journal = Self {
            path: path.to_owned(),
            file,
            checksum: Checksum::START,
            synced: Instant::now(),
            damaged: 0,
        };
        let Some(contents) = admitted(path, &bytes, existing, |found| found.difference(header))?
        else {
            journal.start(header)?;
            return Ok((journal, Vec::new()));
        };
        journal.checksum = contents.checksum;
        journal.damaged = contents.damaged;
        let end = contents.end as u64;
        journal.file.set_len(end).map_err(|source| journal.failed("shorten", source))?;
        journal.file.seek(SeekFrom::Start(end)).map_err(|source| journal.failed("read", source))?;
        Ok((journal, contents.records))
    }

    /// Whether [`open`](Self::open) will accept the file, as far as the fields in `known` tell; touches
    /// nothing.
    ///
    /// # Errors
    /// As `open`.
    pub(crate) fn check(
        path: &Path,
        known: &JournalHeader,
        existing: Existing,
    ) -> Result<(), JournalError> {
        if path.exists() {
            let Locked { bytes, .. } = Locked::open(path, OpenOptions::new().read(true), "read")?;
            admitted(path, &bytes, existing, |found| found.contradiction(known))?;
        }
        Ok(())
    }

    /// Complete lines that were left out, because one of them is damaged.
    pub(crate) fn damaged(&self) -> usize {
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
    pub(crate) fn append(&mut self, record: &str) -> Result<(), JournalError> {
        debug_assert!(!record.contains('\n'), "a record is one line");
        let (whole, checksum) = line(record, self.checksum);
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
        FileError::new(action, &self.path, source).into()
    }
}

/// What a file holds that is to be continued; `None` where it is to be begun.
fn admitted(
    path: &Path,
    bytes: &[u8],
    existing: Existing,
    difference: impl FnOnce(&JournalHeader) -> Option<(String, String, String)>,
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
    if let Some((field, found, expected)) = difference(&contents.header) {
        return Err(JournalError::OtherRun { path, field, found, expected });
    }
    if existing == Existing::Refuse {
        let records = contents.records.len() + contents.damaged;
        return Err(JournalError::HasRecords { path, records });
    }
    Ok(Some(contents))
}

/// Reads a journal that no run is writing: its header and its valid records.
///
/// # Errors
/// When the file cannot be read or is not a journal.
pub(crate) fn read_journal(path: &Path) -> Result<(JournalHeader, Vec<String>), JournalError> {
    let bytes = std::fs::read(path).map_err(|source| FileError::new("read", path, source))?;
    let contents = Contents::read(&bytes)
        .ok_or_else(|| JournalError::NotAJournal { path: path.to_owned() })?;
    Ok((contents.header, contents.records))
}

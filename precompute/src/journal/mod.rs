//! The append-only journal of a run: no rendering is repeated after the run was killed.
//!
//! A text file: a header line that identifies scene and conditions, then one record per line. Every
//! line ends in a checksum over the whole file up to it, which detects torn, changed and missing
//! lines. A journal is read up to its first invalid line, and truncated there. The pipeline is
//! deterministic: a resumed run makes the same requests, and the journal answers them up to the
//! point of interruption.

mod error;
mod line;
#[cfg(test)]
mod tests;

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub(crate) use error::JournalError;
pub(crate) use line::hash;
use line::{Checksum, checked, line};

/// Greatest delay before records reach the disk; they reach the operating system at once. A kill
/// loses nothing, a power cut a second.
const SYNC: Duration = Duration::from_secs(1);

/// First word of a journal, with the version of its format.
const MAGIC: &str = "frugal-journal 2";

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

    /// Name and both values of the first field in which two headers differ.
    fn difference(&self, other: &Self) -> Option<(String, String, String)> {
        let find = |header: &Self, name: &str| {
            header.0.iter().rev().find(|(other, _)| other == name).map(|(_, value)| value.clone())
        };
        let text = |value: Option<String>| value.unwrap_or_else(|| "nothing".to_owned());
        self.0.iter().chain(&other.0).find_map(|(name, _)| {
            let (here, there) = (find(self, name), find(other, name));
            (here != there).then(|| (name.clone(), text(here), text(there)))
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
}

impl Journal {
    /// Starts a journal at `path`, replacing an existing file.
    ///
    /// # Errors
    /// When the file cannot be written, or another run has it open.
    pub(crate) fn create(path: &Path, header: &JournalHeader) -> Result<Self, JournalError> {
        let mut journal = Self::open(path)?;
        journal.start(header)?;
        Ok(journal)
    }

    /// Continues the journal at `path` after its last valid line; starts one if there is none.
    /// Returns its records in the order of writing.
    ///
    /// # Errors
    /// When the file cannot be read and written, is not a journal, belongs to a run with another
    /// header, or another run has it open.
    pub(crate) fn resume(
        path: &Path,
        header: &JournalHeader,
    ) -> Result<(Self, Vec<String>), JournalError> {
        let mut journal = Self::open(path)?;
        let mut bytes = Vec::new();
        journal.file.read_to_end(&mut bytes).map_err(|source| journal.failed("read", source))?;
        let (first, _) = line(&header.text()?, Checksum::START);
        // Killed before the first line was complete: nothing is lost.
        if bytes.len() < first.len() && first.as_bytes().starts_with(&bytes) {
            journal.start(header)?;
            return Ok((journal, Vec::new()));
        }
        let Some(Contents { header: found, records, end, checksum }) = Contents::read(&bytes)
        else {
            return Err(JournalError::NotAJournal { path: path.to_owned() });
        };
        if let Some((field, found, expected)) = found.difference(header) {
            return Err(JournalError::OtherRun { path: path.to_owned(), field, found, expected });
        }
        journal.checksum = checksum;
        journal.file.set_len(end as u64).map_err(|source| journal.failed("shorten", source))?;
        journal
            .file
            .seek(SeekFrom::Start(end as u64))
            .map_err(|source| journal.failed("read", source))?;
        Ok((journal, records))
    }

    fn open(path: &Path) -> Result<Self, JournalError> {
        let failed = |source| JournalError::File { action: "open", path: path.to_owned(), source };
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        match file.try_lock() {
            // Some file systems have no locks; concurrent runs are then not detected.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(JournalError::InUse { path: path.to_owned() });
            }
        }
        Ok(Self { path: path.to_owned(), file, checksum: Checksum::START, synced: Instant::now() })
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
        JournalError::File { action, path: self.path.clone(), source }
    }
}

/// The valid part of a journal.
struct Contents {
    header: JournalHeader,
    records: Vec<String>,
    /// Bytes up to the end of the last valid line.
    end: usize,
    checksum: Checksum,
}

impl Contents {
    /// `None` where the header is invalid.
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut lines =
            bytes.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
        let good = |line: &[u8], before: Checksum| {
            let (text, checksum) =
                checked(std::str::from_utf8(line).ok()?.strip_suffix('\n')?, before)?;
            Some((text.to_owned(), checksum))
        };
        let first = lines.next()?;
        let (text, checksum) = good(first, Checksum::START)?;
        let mut contents = Self {
            header: JournalHeader::read(&text)?,
            records: Vec::new(),
            end: first.len(),
            checksum,
        };
        for line in lines {
            let Some((record, checksum)) = good(line, contents.checksum) else { break };
            contents.records.push(record);
            contents.checksum = checksum;
            contents.end += line.len();
        }
        Some(contents)
    }
}

/// Reads a journal that no run is writing: its header and its valid records.
///
/// # Errors
/// When the file cannot be read or is not a journal.
pub(crate) fn read_journal(path: &Path) -> Result<(JournalHeader, Vec<String>), JournalError> {
    let bytes = std::fs::read(path).map_err(|source| JournalError::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    let contents = Contents::read(&bytes)
        .ok_or_else(|| JournalError::NotAJournal { path: path.to_owned() })?;
    Ok((contents.header, contents.records))
}

/// Merges journals of one run, each with a share of its records, into one at `output`: every record
/// once, in the order of the files.
///
/// # Errors
/// When a file cannot be read, is not a journal, or belongs to another run than the first; nothing
/// is written then.
pub(crate) fn merge_journals(files: &[PathBuf], output: &Path) -> Result<usize, JournalError> {
    let mut header: Option<JournalHeader> = None;
    let mut seen = std::collections::HashSet::new();
    let mut merged: Vec<String> = Vec::new();
    for file in files {
        let (found, records) = read_journal(file)?;
        let expected = header.get_or_insert_with(|| found.clone());
        if let Some((field, found, expected)) = found.difference(expected) {
            return Err(JournalError::OtherRun { path: file.clone(), field, found, expected });
        }
        merged.extend(records.into_iter().filter(|record| seen.insert(record.clone())));
    }
    let mut text = String::new();
    let mut checksum = Checksum::START;
    for record in std::iter::once(header.unwrap_or_default().text()?).chain(merged.iter().cloned())
    {
        let (whole, next) = line(&record, checksum);
        text.push_str(&whole);
        checksum = next;
    }
    crate::files::write_atomically(output, |file| file.write_all(text.as_bytes())).map_err(
        |error| JournalError::File {
            action: "write",
            path: output.to_owned(),
            source: error.source,
        },
    )?;
    Ok(merged.len())
}

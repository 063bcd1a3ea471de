//! The append-only journal of a run: no rendering is repeated after the run was killed.
//!
//! A text file: a header line that identifies scene and conditions, then one record per line, each
//! with a checksum, which detects torn and changed lines. These are left out. The pipeline is
//! deterministic: a resumed run makes the same requests, and the journal answers what it knows. A run
//! writes its own journal and may read others of the same run, such as those of other shards.

mod contents;
#[cfg(test)]
mod tests;

use std::collections::HashSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::files::FileError;

use contents::{Contents, MAGIC, is_of_us, is_unbegun, line};
pub use contents::{cost_record, hash, read_cost};

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

    /// An error that names the first field in which this header, of the journal at `path`, differs from
    /// the `run`'s.
    fn check(&self, run: &Self, path: &Path) -> Result<(), JournalError> {
        let differs = |(name, _): &&(String, String)| self.value(name) != run.value(name);
        let Some((field, _)) = run.0.iter().chain(&self.0).find(differs) else { return Ok(()) };
        let text = |of: &Self| of.value(field).map_or("nothing", String::as_str).to_owned();
        let (path, field) = (path.to_owned(), field.clone());
        Err(JournalError::OtherRun { path, found: text(self), expected: text(run), field })
    }

    fn text(&self) -> String {
        format!("{MAGIC} {}", serde_json::json!(self.0))
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
        let failed = |action| move |source| FileError::new(action, path, source);
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(failed("open"))?;
        // Some file systems have no locks; there nobody can tell whether it is in use.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(JournalError::InUse { path: path.to_owned() });
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed("open"))?;
        let contents = admitted(path, &bytes, existing, header)?;
        let is_new = contents.is_none();
        let (end, damaged, records) =
            contents.map_or((0, 0, Vec::new()), |it| (it.end as u64, it.damaged, it.records));
        file.set_len(end).map_err(failed("shorten"))?;
        file.seek(SeekFrom::Start(end)).map_err(failed("read"))?;
        let mut journal = Self { path: path.to_owned(), file, synced: Instant::now(), damaged };
        if is_new {
            journal.append(&header.text())?;
        }
        Ok((journal, records))
    }

    /// Complete lines that were left out, because they are damaged.
    pub fn damaged(&self) -> usize {
        self.damaged
    }

    /// Adds a record: text without line breaks.
    ///
    /// # Errors
    /// When the file cannot be written. Earlier records stay readable.
    pub fn append(&mut self, record: &str) -> Result<(), JournalError> {
        debug_assert!(!record.contains('\n'), "a record is one line");
        let failed = |source| FileError::new("write", &self.path, source);
        // One write, so that a kill leaves a whole line or a torn one, never two halves.
        self.file.write_all(line(record).as_bytes()).map_err(failed)?;
        if self.synced.elapsed() >= SYNC {
            self.file.sync_data().map_err(failed)?;
            self.synced = Instant::now();
        }
        Ok(())
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
    if contents.records.is_empty() && contents.damaged == 0 {
        // Nothing is lost where it is begun anew.
        return Ok(None);
    }
    contents.header.check(header, &path)?;
    if existing == Existing::Refuse {
        let records = contents.records.len() + contents.damaged;
        return Err(JournalError::HasRecords { path, records });
    }
    Ok(Some(contents))
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
    found.check(header, path)?;
    Ok(records)
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

/// Why there is no journal. The text is the fault alone: what helps depends on the options of the
/// command, which adds it.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// A file operation failed.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file is not a journal, or its first line is damaged.
    #[error("`{path}` is not a journal of this version, or its first line is damaged", path = path.display())]
    NotAJournal {
        /// The file.
        path: PathBuf,
    },
    /// The journal holds an earlier run's records, which nobody asked to use or to drop.
    #[error("the journal `{path}` holds {records} records of an earlier run", path = path.display())]
    HasRecords {
        /// The journal.
        path: PathBuf,
        /// How many.
        records: usize,
    },
    /// The journal belongs to another run.
    #[error(
        "the journal `{path}` is of another run: its {field} is `{found}`, here it is `{expected}`",
        path = path.display()
    )]
    OtherRun {
        /// The journal.
        path: PathBuf,
        /// The field that differs.
        field: String,
        /// The journal's value.
        found: String,
        /// This run's value.
        expected: String,
    },
    /// Another process has the journal open.
    #[error("the journal `{path}` is in use by another process", path = path.display())]
    InUse {
        /// The journal.
        path: PathBuf,
    },
}

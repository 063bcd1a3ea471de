//! Merging: the journals of one run, each with a share of its records, become the whole.

use std::collections::HashSet;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use super::contents::{Contents, Locked, is_unbegun};
use super::line::{Checksum, line};
use super::{JournalError, JournalHeader};
use crate::files::write_atomically;

/// Merges `files`: every record once, in the order of the files. The whole goes to `output`, else over
/// each of the files. Returns the number of records, and what was written.
///
/// All files are locked meanwhile, as a run locks its own: none that is being written is read, and
/// none is replaced under a process that writes it.
///
/// # Errors
/// When a file cannot be read, is not a journal, is in use, or belongs to another run than the first,
/// or when `output` holds anything else; nothing is written then.
pub(crate) fn merge_journals(
    files: &[PathBuf],
    output: Option<&Path>,
) -> Result<(usize, Vec<PathBuf>), JournalError> {
    let mut locks: Vec<Locked> = Vec::new();
    let mut opened: Vec<(PathBuf, PathBuf)> = Vec::new();
    let mut header: Option<JournalHeader> = None;
    let mut seen = HashSet::new();
    let mut merged: Vec<String> = Vec::new();
    for file in files {
        let same = std::fs::canonicalize(file).unwrap_or_else(|_| file.clone());
        if opened.iter().any(|(_, other)| *other == same) {
            continue;
        }
        let locked = lock(file)?;
        let Some(Contents { header: found, records, .. }) = Contents::read(&locked.bytes) else {
            return Err(JournalError::NotAJournal { path: file.clone() });
        };
        let expected = header.get_or_insert_with(|| found.clone());
        if let Some((field, found, expected)) = found.difference(expected) {
            return Err(JournalError::OtherRun { path: file.clone(), field, found, expected });
        }
        merged.extend(records.into_iter().filter(|record| seen.insert(record.clone())));
        locks.push(locked);
        opened.push((file.clone(), same));
    }
    if let Some(output) = output.filter(|output| output.exists()) {
        let same = std::fs::canonicalize(output).unwrap_or_else(|_| output.to_owned());
        if opened.iter().all(|(_, other)| *other != same) {
            let locked = lock(output)?;
            check_replaceable(output, &locked.bytes)?;
            locks.push(locked);
        }
    }
    let outputs: Vec<PathBuf> = match output {
        Some(output) => vec![output.to_owned()],
        None => opened.into_iter().map(|(file, _)| file).collect(),
    };
    let mut text = String::new();
    let mut checksum = Checksum::START;
    for record in std::iter::once(header.unwrap_or_default().text()?).chain(merged.iter().cloned())
    {
        let (whole, next) = line(&record, checksum);
        text.push_str(&whole);
        checksum = next;
    }
    for output in &outputs {
        write_atomically(output, |file| file.write_all(text.as_bytes()))?;
    }
    // Not before: a run that starts meanwhile must not open a file that is about to be replaced.
    drop(locks);
    Ok((merged.len(), outputs))
}

fn lock(path: &Path) -> Result<Locked, JournalError> {
    let mut options = OpenOptions::new();
    options.read(true);
    // Some file systems lock only what is open for writing.
    let is_writable = std::fs::metadata(path).is_ok_and(|file| !file.permissions().readonly());
    let locked = match Locked::open(path, options.clone().write(is_writable), "read") {
        Err(JournalError::File(error)) if is_writable && error.is_denied() => {
            Locked::open(path, &options, "read")?
        }
        locked => locked?,
    };
    if locked.is_certain {
        Ok(locked)
    } else {
        Err(JournalError::NoLocks { path: path.to_owned() })
    }
}

/// Fails where a file that is none of the merged ones holds something.
fn check_replaceable(path: &Path, bytes: &[u8]) -> Result<(), JournalError> {
    let path = path.to_owned();
    match Contents::read(bytes) {
        _ if is_unbegun(bytes) => Ok(()),
        Some(contents) if contents.is_empty() => Ok(()),
        Some(contents) => Err(JournalError::HasRecords { path, records: contents.records.len() }),
        None => Err(JournalError::NotAJournal { path }),
    }
}

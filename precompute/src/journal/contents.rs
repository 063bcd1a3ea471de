//! What a journal's file holds, and who has it open.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::Read as _;
use std::path::Path;

use super::line::{Checksum, checked};
use super::{JournalError, JournalHeader, MAGIC};
use crate::files::FileError;

/// The valid part of a journal.
pub(super) struct Contents {
    pub header: JournalHeader,
    pub records: Vec<String>,
    /// Bytes up to the end of the last valid line.
    pub end: usize,
    pub checksum: Checksum,
    /// Complete lines after it, which are damaged or follow a damaged one.
    pub damaged: usize,
}

impl Contents {
    /// `None` where the header is invalid.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
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
            damaged: 0,
        };
        for line in lines {
            let Some((record, checksum)) = good(line, contents.checksum) else { break };
            contents.records.push(record);
            contents.checksum = checksum;
            contents.end += line.len();
        }
        contents.damaged = bytes[contents.end..].iter().filter(|byte| **byte == b'\n').count();
        Some(contents)
    }

    /// Whether nothing is lost where the file is begun anew.
    pub(super) fn is_empty(&self) -> bool {
        self.records.is_empty() && self.damaged == 0
    }
}

/// Whether the run that made the file was killed before its first line was complete. After a power
/// cut there may be zeros.
pub(super) fn is_unbegun(bytes: &[u8]) -> bool {
    let zeros = bytes.iter().rev().take_while(|byte| **byte == 0).count();
    let bytes = &bytes[..bytes.len() - zeros];
    let begins = bytes.starts_with(MAGIC.as_bytes()) || MAGIC.as_bytes().starts_with(bytes);
    begins && !bytes.contains(&b'\n')
}

/// Whether the file is ours, of whatever version.
pub(super) fn is_of_us(bytes: &[u8]) -> bool {
    let name = MAGIC.split(' ').next().unwrap_or(MAGIC);
    bytes.starts_with(name.as_bytes())
}

/// A journal's file that no other process has open, and whether that is known: some file systems
/// have no locks.
pub(super) struct Locked {
    pub file: File,
    pub bytes: Vec<u8>,
    pub is_certain: bool,
}

impl Locked {
    /// Opens the file at `path`, which is made where there is none and `options` create it, for an
    /// `action`.
    pub(super) fn open(
        path: &Path,
        options: &OpenOptions,
        action: &'static str,
    ) -> Result<Self, JournalError> {
        let failed = |action| move |source| FileError::new(action, path, source);
        let mut tries = 9;
        loop {
            let mut file = options.open(path).map_err(failed(action))?;
            let is_certain = match file.try_lock() {
                Ok(()) => true,
                Err(TryLockError::Error(_)) => false,
                Err(TryLockError::WouldBlock) => {
                    return Err(JournalError::InUse { path: path.to_owned() });
                }
            };
            // A merge may have put another file in its place before it was locked. Some file systems
            // number a file anew each time.
            if tries == 0 || is_at(&file, path) {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes).map_err(failed("read"))?;
                return Ok(Self { file, bytes, is_certain });
            }
            tries -= 1;
        }
    }
}

/// Whether `path` still leads to `file`.
#[cfg(unix)]
pub(super) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let id = |metadata: &std::fs::Metadata| (metadata.dev(), metadata.ino());
    matches!((file.metadata(), std::fs::metadata(path)), (Ok(ref a), Ok(ref b)) if id(a) == id(b))
}

#[cfg(not(unix))]
pub(super) fn is_at(_: &File, _: &Path) -> bool {
    true
}

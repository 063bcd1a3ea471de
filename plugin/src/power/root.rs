//! The folder under which the kernel's files lie, and reading of one number with its faults.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use crate::power::MeterError;

/// Longest number in a file, bytes: more is no number.
const MAX_BYTES: u64 = 64;

/// Environment variable that names another root.
const ROOT_VARIABLE: &str = "FRUGAL_SYS_ROOT";

/// The root of the system's files: `/`, or the folder in `FRUGAL_SYS_ROOT`, for tests by hand.
#[derive(Clone, Debug)]
pub(crate) struct SysRoot {
    root: PathBuf,
    open: fn(&Path) -> io::Result<File>,
}

impl Default for SysRoot {
    fn default() -> Self {
        let other = std::env::var_os(ROOT_VARIABLE).filter(|root| !root.is_empty());
        let root = other.map_or_else(|| PathBuf::from("/"), PathBuf::from);
        Self { root, open: |path| File::open(path) }
    }
}

impl SysRoot {
    /// Another root, and another way to open files: tests run as root, whom no file denies access.
    #[cfg(test)]
    pub(crate) fn new(root: PathBuf, open: fn(&Path) -> io::Result<File>) -> Self {
        Self { root, open }
    }

    /// A path under the root.
    pub(crate) fn path(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    /// Folders and links in `folder` that have such a name, sorted; none where there is no folder.
    pub(crate) fn list(&self, folder: &Path, is_named: impl Fn(&str) -> bool) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let named = entries.filter(|entry| entry.file_name().to_str().is_some_and(&is_named));
        let mut found: Vec<PathBuf> = named.map(|entry| entry.path()).collect();
        found.sort();
        found
    }

    /// Folders and links `prefixN` in `folder`, sorted.
    pub(crate) fn numbered(&self, folder: &Path, prefix: &str) -> Vec<PathBuf> {
        self.list(folder, |name| {
            let number = name.strip_prefix(prefix).unwrap_or_default();
            !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
        })
    }

    /// The same with the names in their files `name`; none where there is no such file.
    pub(crate) fn named(&self, folder: &Path, prefix: &str) -> Vec<(PathBuf, String)> {
        let folders = self.numbered(folder, prefix).into_iter();
        folders
            .filter_map(|found| self.word(&found.join("name")).map(|name| (found, name)))
            .collect()
    }

    /// A file with one number.
    pub(crate) fn number(&self, path: PathBuf) -> NumberFile {
        NumberFile { path, open: self.open }
    }

    /// The first line of a file, without white space around it; `None` where it cannot be read.
    pub(crate) fn word(&self, path: &Path) -> Option<String> {
        let text = self.text(path)?;
        let word = text.lines().next().unwrap_or_default().trim();
        (!word.is_empty()).then(|| word.to_owned())
    }

    /// The text of a short file; `None` where it cannot be read.
    pub(crate) fn text(&self, path: &Path) -> Option<String> {
        let bytes = read(self.open, path, 4096).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// A file with one whole number.
#[derive(Clone, Debug)]
pub(crate) struct NumberFile {
    path: PathBuf,
    open: fn(&Path) -> io::Result<File>,
}

/// Why a file has no number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    Gone,
    /// This user may not read it.
    Denied,
    /// The driver refuses: what `amdgpu` answers for a card that sleeps.
    Refused(String),
    /// The driver has no value now.
    Busy(String),
    Failed(String),
    NotANumber(String),
}

impl From<io::Error> for Fault {
    fn from(error: io::Error) -> Self {
        // Linux' numbers; these files are Linux'.
        const EPERM: i32 = 1;
        const EAGAIN: i32 = 11;
        const EBUSY: i32 = 16;
        const ENODEV: i32 = 19;
        const ENODATA: i32 = 61;
        match error.raw_os_error() {
            Some(EPERM) => Self::Refused(error.to_string()),
            Some(EAGAIN | EBUSY | ENODATA) => Self::Busy(error.to_string()),
            // Of a device that went while its file was open.
            Some(ENODEV) => Self::Gone,
            _ => match error.kind() {
                ErrorKind::NotFound => Self::Gone,
                ErrorKind::PermissionDenied => Self::Denied,
                _ => Self::Failed(error.to_string()),
            },
        }
    }
}

impl NumberFile {
    /// The file's path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The file's number now.
    ///
    /// # Errors
    /// [`Fault`] says why there is none.
    pub(crate) fn read(&self) -> Result<i64, Fault> {
        let bytes = read(self.open, &self.path, MAX_BYTES)?;
        let text = String::from_utf8_lossy(&bytes);
        text.trim().parse().map_err(|_| Fault::NotANumber(text.trim().to_owned()))
    }

    /// The meter's error for a fault of this file. `remedy`: what to do where access is denied.
    pub(crate) fn error(&self, meter: &str, fault: Fault, remedy: &str) -> MeterError {
        let path = self.path.display();
        let reason = match fault {
            Fault::Gone => {
                format!("{path} is gone: was the device unplugged or its driver unloaded?")
            }
            Fault::Denied => format!("permission denied for {path}: {remedy}"),
            Fault::Refused(error) => format!("{path}: {error}: {remedy}"),
            Fault::Busy(error) | Fault::Failed(error) => format!("{path}: {error}"),
            Fault::NotANumber(text) => {
                return MeterError::broken(meter, format!("{path} reads \"{text}\", no number"));
            }
        };
        MeterError::unreadable(meter, reason)
    }
}

/// The file's first bytes.
fn read(open: fn(&Path) -> io::Result<File>, path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

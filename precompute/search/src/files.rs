//! Atomic output files.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// Why an output file cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} `{path}`: {source}; {remedy}", path = path.display())]
pub struct FileError {
    /// The operation.
    pub action: &'static str,
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    pub source: io::Error,
    /// The remedy.
    pub remedy: &'static str,
}

impl FileError {
    /// `action`: the operation, a verb. The remedy follows from the error.
    pub fn new(action: &'static str, path: &Path, source: io::Error) -> Self {
        let remedy = match source.kind() {
            io::ErrorKind::NotFound if action == "read" => "give a file that is there",
            io::ErrorKind::NotFound => "create its folder first",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                "allow writing there, or give another output"
            }
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                "free some space, then run again"
            }
            io::ErrorKind::IsADirectory => "give a file's name",
            _ => "give another output",
        };
        Self { action, path: path.to_owned(), source, remedy }
    }
}

/// Writes `path` atomically: at any time it holds either its old content or all that `write`
/// writes, even if the process or the machine fails.
///
/// A temporary file in the same folder is written, synced to disk, and renamed. If `path` is a
/// link, its target is replaced.
///
/// # Errors
/// When `write` fails or the file cannot be written; `path` is then unchanged, and the temporary
/// file is removed.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), FileError> {
    let failed = |source| FileError::new("write", path, source);
    let target = target(path).map_err(failed)?;
    let mut temporary = temporary_beside(&target).map_err(failed)?;
    let mut buffer = BufWriter::new(temporary.as_file_mut());
    write(&mut buffer).and_then(|()| buffer.flush()).map_err(failed)?;
    drop(buffer);
    temporary.as_file().sync_all().map_err(failed)?;
    temporary.persist(&target).map_err(|error| failed(error.error))?;
    sync_folder(&target).map_err(failed)
}

/// Checks whether [`write_atomically`] can write `path`: for use before long work.
///
/// # Errors
/// When the folder is missing or not writable, or `path` is a folder, a device or a read-only file.
/// Leaves no files behind.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    let failed = |source| FileError::new("write", path, source);
    let target = target(path).map_err(failed)?;
    let mut temporary = temporary_beside(&target).map_err(failed)?;
    // One byte, because a full disk allows new files but no content.
    temporary.write_all(&[0]).map_err(failed)
}

/// The file at `path`, with links resolved; an error if it must not be replaced.
fn target(path: &Path) -> io::Result<PathBuf> {
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if target.file_name().is_none() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    match fs::metadata(&target) {
        Ok(metadata) if metadata.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
        // A rename would replace `/dev/null` itself, and `/dev/stdout` gets nothing.
        Ok(metadata) if !metadata.is_file() => Err(io::Error::other("it is a device or a pipe")),
        // A rename would replace a read-only file, against its owner's intent.
        Ok(metadata) if metadata.permissions().readonly() => {
            Err(io::ErrorKind::PermissionDenied.into())
        }
        _ => Ok(target),
    }
}

fn folder(target: &Path) -> &Path {
    target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A temporary file on the same file system, so that the rename is atomic.
fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".frugal-").suffix(".part");
    // The default permissions of a new file; temporary files are private, and the rename would keep
    // that.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder(target))
}

/// Syncs the rename to disk.
fn sync_folder(target: &Path) -> io::Result<()> {
    // Other systems cannot open folders as files.
    if cfg!(unix) { File::open(folder(target))?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("map.ron");
        write_atomically(&path, |file| file.write_all(b"old")).expect("can be written");
        let failure = write_atomically(&path, |file| {
            file.write_all(b"half").and(Err(io::Error::other("out of ideas")))
        });
        let message = failure.expect_err("the writer failed").to_string();
        assert!(message.contains("map.ron") && message.contains("out of ideas"), "{message}");
        assert_eq!(fs::read(&path).expect("still there"), b"old");
        write_atomically(&path, |file| file.write_all(b"new")).expect("can be replaced");
        assert_eq!(fs::read(&path).expect("still there"), b"new");
        assert_eq!(names(folder.path()), ["map.ron"]);
    }

    #[test]
    fn unwritable_paths_are_reported_before_the_work() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("map.ron");
        check_writable(&path).expect("a fresh name in a folder");
        assert_eq!(names(folder.path()), [""; 0], "nothing is left behind");
        let missing = check_writable(&folder.path().join("no/such/map.ron"))
            .expect_err("no folder")
            .to_string();
        assert!(
            missing.contains("no/such/map.ron") && missing.contains("create its folder"),
            "{missing}"
        );
        assert!(
            check_writable(folder.path())
                .expect_err("a folder")
                .to_string()
                .contains("give a file's name")
        );
        fs::write(&path, b"precious").expect("can be written");
        let mut permissions = fs::metadata(&path).expect("there").permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&path, permissions).expect("can be marked");
        assert!(check_writable(&path).is_err() && write_atomically(&path, |_| Ok(())).is_err());
        assert_eq!(fs::read(&path).expect("still there"), b"precious");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_neither_file_nor_folder_is_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("socket");
        let _socket = std::os::unix::net::UnixListener::bind(&path).expect("a socket");
        for error in [check_writable(&path), write_atomically(&path, |_| Ok(()))] {
            let message = error.expect_err("no file").to_string();
            assert!(message.contains("give another output"), "{message}");
        }
        assert!(!fs::metadata(&path).expect("still there").is_file());
    }

    #[cfg(unix)]
    #[test]
    fn outputs_are_as_readable_as_other_files_and_links_stay_links() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().expect("a folder");
        let (plain, ours, link) =
            (folder.path().join("plain"), folder.path().join("ours"), folder.path().join("link"));
        fs::write(&plain, b"").expect("can be written");
        write_atomically(&ours, |_| Ok(())).expect("can be written");
        let mode = |path: &Path| fs::metadata(path).expect("there").permissions().mode();
        assert_eq!(mode(&plain), mode(&ours));
        std::os::unix::fs::symlink(&ours, &link).expect("can be linked");
        write_atomically(&link, |file| file.write_all(b"through")).expect("can be written");
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
        assert_eq!(fs::read(&ours).expect("there"), b"through");
    }
}

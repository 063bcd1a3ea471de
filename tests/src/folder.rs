//! Where the tests' files are.

use std::path::{Path, PathBuf};

/// The folder of this package.
///
/// Clones that share one build share executables, too, and those know the folder of the clone that
/// was built first. What the running Cargo says goes before it.
pub fn package() -> PathBuf {
    std::env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| env!("CARGO_MANIFEST_DIR").into(), PathBuf::from)
}

/// The folder of the workspace.
pub fn workspace() -> PathBuf {
    package().join("..")
}

/// The files with an extension in a folder and those under it, sorted within each.
///
/// # Errors
/// When a folder cannot be read.
pub fn files(folder: &Path, extension: &str) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(self::files(&path, extension)?);
        } else if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

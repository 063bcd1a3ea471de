//! Where the tests' files are.

use std::path::PathBuf;

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

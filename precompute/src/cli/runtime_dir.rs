//! A runtime directory for Mesa, which complains on standard error where there is none.

use std::fs::{self, DirBuilder};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

const VARIABLE: &str = "XDG_RUNTIME_DIR";

/// Starts this program once more, in the same process, with a private runtime directory, where the
/// environment names none. Does nothing where that fails: the directory only quietens Mesa.
///
/// A program must not change its own environment once it may have threads, as drivers start them.
pub(super) fn provide() {
    if std::env::var_os(VARIABLE).is_some_and(|directory| !directory.is_empty()) {
        return;
    }
    let (Some(directory), Ok(program)) = (private_directory(), std::env::current_exe()) else {
        return;
    };
    let mut arguments = std::env::args_os();
    let mut command = Command::new(program);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    // Returns only where it fails.
    let _ = command.args(arguments).env(VARIABLE, directory).exec();
}

/// A directory of this user's own, which others can neither read nor have made.
fn private_directory() -> Option<PathBuf> {
    let user = rustix::process::geteuid().as_raw();
    let directory = std::env::temp_dir().join(format!("frugal-{user}"));
    let _ = DirBuilder::new().mode(0o700).create(&directory);
    let found = fs::symlink_metadata(&directory).ok()?;
    let is_private =
        found.is_dir() && found.uid() == user && found.permissions().mode() & 0o077 == 0;
    is_private.then_some(directory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directory_is_private_and_kept() {
        let directory = private_directory().expect("a directory");
        assert_eq!(fs::metadata(&directory).expect("it").permissions().mode() & 0o777, 0o700);
        assert_eq!(private_directory(), Some(directory));
    }
}

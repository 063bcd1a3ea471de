//! The `frugal` command as a binary of this package: before it runs a package's tests, Cargo builds
//! only that package's binaries.

use std::process::ExitCode;

fn main() -> ExitCode {
    frugal::cli::run()
}

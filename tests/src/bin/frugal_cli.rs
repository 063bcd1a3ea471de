//! The `frugal` command once more: cargo builds the binaries of this package, and of no other,
//! before it runs this package's tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    frugal::cli::run()
}

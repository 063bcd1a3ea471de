//! The `frugal` command: see the library's `cli`.

use std::process::ExitCode;

fn main() -> ExitCode {
    frugal::cli::run()
}

//! Runs the `frugal` command.

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// `frugal` with arguments, in `folder`, with nothing on its input.
pub(crate) fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_frugal_cli"));
    // Drivers print warnings if the variable is not set.
    command.args(arguments).current_dir(folder).env("XDG_RUNTIME_DIR", folder).stdin(Stdio::null());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs `frugal` until it exits.
pub(crate) fn run(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments)
        .output()
        .unwrap_or_else(|error| panic!("frugal does not start: {error}"))
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Asserts that a run was refused: exit status 2, one message that contains all of `words`, no
/// panic, nothing on standard output.
pub(crate) fn assert_refused(output: &Output, words: &[&str]) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(2), "status of: {message}");
    assert!(!message.contains("panicked") && !message.contains("RUST_BACKTRACE"), "{message}");
    // The message starts with the program's name, or is clap's, which starts with `error:` and may
    // have usage lines.
    let starts = message
        .lines()
        .filter(|line| line.starts_with("frugal: ") || line.starts_with("error: "))
        .count();
    assert_eq!(starts, 1, "one message: {message}");
    assert!(
        message.starts_with("frugal: ") || message.starts_with("error: "),
        "nothing but the message: {message}"
    );
    words
        .iter()
        .for_each(|word| assert!(message.contains(word), "`{word}` is missing in: {message}"));
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
}

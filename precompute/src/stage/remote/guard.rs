//! Between the tool and an app's command: ends that, with all that it has started, when the tool is
//! gone, however it ended. A command such as `cargo run` starts further processes, which know nothing
//! of the tool.

use std::io::Read as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};

use bevy_frugal_gi::stage::protocol::STAGE_VARIABLE;

/// Name of the hidden command.
pub(crate) const GUARD_COMMAND: &str = "stage-guard";

/// Runs `command` in the system's shell until it ends, or standard input does.
pub(crate) fn guard(command: &str) -> ExitCode {
    std::thread::spawn(|| {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        end_all();
    });
    let mut shell = if cfg!(windows) {
        let mut shell = Command::new("cmd");
        shell.args(["/C", command]);
        shell
    } else {
        let mut shell = Command::new("sh");
        shell.args(["-c", command]);
        shell
    };
    match shell.stdin(Stdio::null()).status() {
        Ok(status) => {
            eprintln!("`{command}` ended: {status}");
            // What it has left running is of no use.
            end_all();
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("cannot run `{command}`: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Ends this process and its group, of which the tool made it the leader. Takes away the socket that a
/// killed tool has left.
fn end_all() {
    if let Some(address) = std::env::var_os(STAGE_VARIABLE).map(PathBuf::from) {
        let _ = std::fs::remove_file(&address);
        let _ = address.parent().map(std::fs::remove_dir);
    }
    #[cfg(unix)]
    let _ = rustix::process::kill_current_process_group(rustix::process::Signal::KILL);
    #[cfg(not(unix))]
    std::process::exit(1);
}

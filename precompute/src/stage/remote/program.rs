//! The program of a stage: what it is, its process, and what it said last; and a guard between the tool and
//! an app's command.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, ExitCode, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bevy_frugal_gi::stage::StageError;
use bevy_frugal_gi::stage::protocol::{LEVEL_VARIABLE, STAGE_VARIABLE};

/// Name of the hidden command that renders a scene file.
const CHILD_COMMAND: &str = "stage-worker";
/// Name of the hidden command that runs an app's.
const GUARD_COMMAND: &str = "stage-guard";
/// Environment variable for the number of threads of the software driver lavapipe; other drivers
/// ignore it.
const LAVAPIPE_THREADS: &str = "LP_NUM_THREADS";
/// What a program said is kept up to this many bytes, and shown up to this many lines.
const KEPT_BYTES: usize = 16 << 10;
const SHOWN_LINES: usize = 12;
/// Time in which a program that has broken off ends, and its last words arrive.
const LAST_WORDS: Duration = Duration::from_millis(500);

/// What is started as a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Program {
    /// This program with a scene file.
    File(PathBuf),
    /// A user's app, by the command that starts it.
    App {
        /// For the system's shell.
        command: String,
        /// The level to load.
        level: Option<String>,
        /// Longest wait for its connection, its level, and each answer.
        patience: Duration,
    },
}

impl Program {
    /// `None`: forever.
    pub(super) fn patience(&self) -> Option<Duration> {
        match self {
            Self::File(_) => None,
            Self::App { patience, .. } => Some(*patience),
        }
    }

    fn command(&self) -> io::Result<Command> {
        let mut start = Command::new(std::env::current_exe()?);
        match self {
            Self::File(scene) => start.arg(CHILD_COMMAND).env(LEVEL_VARIABLE, scene),
            Self::App { command, level, .. } => {
                start.args([GUARD_COMMAND, command]);
                match level {
                    Some(level) => start.env(LEVEL_VARIABLE, level),
                    None => start.env_remove(LEVEL_VARIABLE),
                }
            }
        };
        Ok(start)
    }

    /// The program in an error message.
    pub(super) fn name(&self) -> String {
        match self {
            Self::File(_) => "the renderer's process".to_owned(),
            Self::App { command, .. } => format!("the app `{command}`"),
        }
    }
}

/// A started program, which ends when this does.
pub(super) struct Running {
    child: Child,
    /// Its guard ends when this closes.
    leash: Option<ChildStdin>,
    said: Arc<Mutex<VecDeque<u8>>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // A guard kills what it guards before itself.
        if self.leash.take().is_none() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

impl Running {
    /// Starts `program`, which is to connect to `address`. `threads`: of a software driver; `None`: as
    /// many as it likes.
    pub(super) fn start(
        program: &Program,
        address: &str,
        threads: Option<usize>,
    ) -> io::Result<Self> {
        let mut command = program.command()?;
        command.env(STAGE_VARIABLE, address).env("NO_COLOR", "1");
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let is_app = matches!(program, Program::App { .. });
        command.stdin(if is_app { Stdio::piped() } else { Stdio::null() });
        if let Some(threads) = threads.filter(|_| std::env::var_os(LAVAPIPE_THREADS).is_none()) {
            command.env(LAVAPIPE_THREADS, threads.to_string());
        }
        // Only this process handles the interrupt key: in the same process group it would kill the
        // child in mid-frame. A guard kills its group.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let said = Arc::new(Mutex::new(VecDeque::new()));
        if let Some(output) = child.stdout.take() {
            keep(output, &said);
        }
        if let Some(output) = child.stderr.take() {
            keep(output, &said);
        }
        let leash = child.stdin.take();
        Ok(Self { child, leash, said })
    }

    /// Whether it has ended.
    pub(super) fn has_ended(&mut self) -> io::Result<bool> {
        Ok(self.child.try_wait()?.is_some())
    }

    /// `problem`, with how the program ended, if it did, and its last words.
    pub(super) fn describe(&mut self, problem: &str) -> StageError {
        let start = Instant::now();
        let mut end = self.child.try_wait().ok().flatten();
        while end.is_none() && start.elapsed() < LAST_WORDS {
            std::thread::sleep(Duration::from_millis(10));
            end = self.child.try_wait().ok().flatten();
        }
        // Pipes are read by threads.
        std::thread::sleep(Duration::from_millis(50));
        let mut said = self.said.lock().map(|said| said.clone()).unwrap_or_default();
        let said = String::from_utf8_lossy(said.make_contiguous()).into_owned();
        // A guard says itself how its command ended.
        let end = end.filter(|_| self.leash.is_none());
        let end = end.map_or_else(String::new, |status| format!(" ({status})"));
        StageError::failed(match last_words(&said).as_slice() {
            [] => format!("{problem}{end}; it said nothing"),
            lines => format!("{problem}{end}; it said:\n  {}", lines.join("\n  ")),
        })
    }
}

/// The lines of `said` that tell most: those from a panic on, without the way to it, else the last.
fn last_words(said: &str) -> Vec<&str> {
    let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = lines.len().saturating_sub(SHOWN_LINES);
    let panic = lines.iter().position(|line| line.contains("panicked at"));
    let from = panic.map_or(last, |panic| panic.min(last));
    let is_way = |line: &&str| {
        let line = line.trim_start();
        let is_frame =
            line.split_once(": ").is_some_and(|(number, _)| number.parse::<u32>().is_ok());
        panic.is_some() && (is_frame || line.starts_with("at /"))
    };
    lines[from..].iter().copied().filter(|line| !is_way(line)).take(SHOWN_LINES).collect()
}

/// Keeps the end of what comes from `output`, however much that is.
fn keep(mut output: impl Read + Send + 'static, said: &Arc<Mutex<VecDeque<u8>>>) {
    let said = Arc::clone(said);
    std::thread::spawn(move || {
        let mut bytes = vec![0; 64 << 10];
        while let Ok(count @ 1..) = output.read(&mut bytes) {
            if let Ok(mut said) = said.lock() {
                said.extend(&bytes[count.saturating_sub(KEPT_BYTES)..count]);
                let excess = said.len().saturating_sub(KEPT_BYTES);
                said.drain(..excess);
            }
        }
    });
}

/// Runs `command` in the system's shell until it ends, or standard input does: the tool is gone, however
/// it ended. Then all that it has started ends: a command such as `cargo run` starts further processes,
/// which know nothing of the tool.
pub(crate) fn guard(command: &str) -> ExitCode {
    std::thread::spawn(|| {
        let _ = io::stdin().read_to_end(&mut Vec::new());
        end_all();
    });
    let (shell, option) = if cfg!(windows) { ("cmd", "/C") } else { ("sh", "-c") };
    match Command::new(shell).args([option, command]).stdin(Stdio::null()).status() {
        Ok(status) => eprintln!("`{command}` ended: {status}"),
        Err(error) => eprintln!("cannot run `{command}`: {error}"),
    }
    // What it has left running is of no use.
    end_all();
    ExitCode::FAILURE
}

/// Ends this process and its group, of which the tool made it the leader.
fn end_all() {
    #[cfg(unix)]
    let _ = rustix::process::kill_current_process_group(rustix::process::Signal::KILL);
    #[cfg(not(unix))]
    std::process::exit(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_shown_without_the_way_to_it_and_else_the_last_lines() {
        let many: String = (0..100).map(|number| format!("line {number}\n\n")).collect();
        let words = last_words(&many);
        assert_eq!(
            (words.len(), words.first(), words.last()),
            (12, Some(&"line 88"), Some(&"line 99"))
        );
        let way: String = (0..40)
            .map(|number| format!("  {number}: a::function\n     at /a/file.rs:1\n"))
            .collect();
        let said = format!(
            "{many}thread 'main' panicked at src/main.rs:7:\nno such door\nstack backtrace:\n{way}ended\n"
        );
        let words = last_words(&said);
        let expected = [
            "thread 'main' panicked at src/main.rs:7:",
            "no such door",
            "stack backtrace:",
            "ended",
        ];
        assert_eq!(words, expected);
        assert!(last_words("\n \n").is_empty());
    }
}

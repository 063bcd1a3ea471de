//! A started program that has connected, and what it said last.

use std::collections::VecDeque;
use std::io::{self, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bevy_frugal_gi::stage::protocol::{
    Answer, Hello, LEVEL_VARIABLE, PROTOCOL, Reply, Request, STAGE_VARIABLE, Socket, receive, send,
};
use bevy_frugal_gi::stage::{StageError, adapter};
use frugal_core::knobs::KnobSpace;

use super::guard::GUARD_COMMAND;
use super::listener::Listener;

/// Name of the hidden command that renders a scene file.
pub(crate) const CHILD_COMMAND: &str = "stage-worker";
/// Environment variable for the number of threads of the software driver lavapipe; other drivers
/// ignore it.
const LAVAPIPE_THREADS: &str = "LP_NUM_THREADS";
/// What a program said is kept up to this many bytes, and shown up to this many lines.
const KEPT_BYTES: usize = 16 << 10;
const SHOWN_LINES: usize = 12;
/// Time in which a program that has broken off ends, and its last words arrive.
const LAST_WORDS: Duration = Duration::from_millis(500);
/// Time that a program has beyond its own limit, to say why it did not keep it.
const GRACE: Duration = Duration::from_secs(10);

/// Why a remote stage gave no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(crate) struct RemoteError {
    /// Whether the cause is the input and not the rendering.
    pub usage: bool,
    /// The message.
    pub message: String,
}

impl RemoteError {
    pub(super) fn failed(message: impl ToString) -> Self {
        Self { usage: false, message: message.to_string() }
    }

    pub(super) fn usage(message: impl ToString) -> Self {
        Self { usage: true, message: message.to_string() }
    }

    pub(super) fn unexpected(answer: &Answer) -> Self {
        Self::failed(format!("the renderer's process sent an unexpected answer: {answer:?}"))
    }
}

impl From<io::Error> for RemoteError {
    fn from(error: io::Error) -> Self {
        Self::failed(error)
    }
}

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
    fn patience(&self) -> Option<Duration> {
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
    fn name(&self) -> String {
        match self {
            Self::File(_) => "the renderer's process".to_owned(),
            Self::App { command, .. } => format!("the app `{command}`"),
        }
    }
}

/// Why a program gave no answer.
pub(super) enum NoAnswer {
    /// It cannot do that, and goes on.
    Failed(RemoteError),
    /// It has ended.
    Broken(RemoteError),
    /// It says nothing.
    Hung(RemoteError),
}

impl From<NoAnswer> for RemoteError {
    fn from(reason: NoAnswer) -> Self {
        match reason {
            NoAnswer::Failed(error) | NoAnswer::Broken(error) | NoAnswer::Hung(error) => error,
        }
    }
}

/// A level that is there.
pub(super) struct Loaded {
    /// Every knob of the app.
    pub knobs: KnobSpace,
    /// Names of the opt-in ones.
    pub opt_in: Vec<String>,
    /// The extracted scene; empty where it was not asked for.
    pub scene: Vec<u8>,
}

/// A program at the other end of a socket. It ends when this does.
pub(super) struct Connection {
    program: Program,
    running: Running,
    input: BufReader<Socket>,
    output: Socket,
    /// What it said of itself.
    pub hello: Hello,
    /// Its size after the last reply, bytes.
    pub resident_bytes: u64,
}

/// A started program.
struct Running {
    child: Child,
    /// Its guard ends when this closes.
    _leash: Option<ChildStdin>,
    said: Arc<Mutex<VecDeque<u8>>>,
}

impl Drop for Running {
    fn drop(&mut self) {
        // A guard kills what it guards before itself.
        if self._leash.take().is_none() {
            let _ = self.child.kill();
        }
        let _ = self.child.wait();
    }
}

impl Running {
    /// Starts `program`, which is to connect to `address`. `threads`: of a software driver; `None`: as
    /// many as it likes.
    fn start(
        program: &Program,
        address: &std::ffi::OsStr,
        threads: Option<usize>,
    ) -> io::Result<Self> {
        let mut command = program.command()?;
        command.env(STAGE_VARIABLE, address);
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
        Ok(Self { child, _leash: leash, said })
    }

    /// `problem`, with how the program ended, if it did, and its last words.
    fn describe(&mut self, problem: &str) -> RemoteError {
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
        let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
        let lines = &lines[lines.len().saturating_sub(SHOWN_LINES)..];
        let end = end.map_or_else(String::new, |status| format!(" ({status})"));
        RemoteError::failed(match lines {
            [] => format!("{problem}{end}; it said nothing"),
            lines => format!("{problem}{end}; its last lines:\n  {}", lines.join("\n  ")),
        })
    }
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

impl Connection {
    /// Starts `program`, waits until it connects, and checks its version.
    ///
    /// # Errors
    /// When it cannot be started, does not connect, or is of another version.
    pub(super) fn open(program: &Program, threads: Option<usize>) -> Result<Self, RemoteError> {
        // Bevy panics without one.
        adapter().ok_or_else(|| RemoteError::usage(StageError::NoAdapter))?;
        let name = program.name();
        let cannot = |error| RemoteError::failed(format!("cannot start {name}: {error}"));
        let listener = Listener::new().map_err(cannot)?;
        let mut running = Running::start(program, &listener.address, threads).map_err(cannot)?;
        let (start, patience) = (Instant::now(), program.patience());
        let waited = patience.map_or(0, |patience| patience.as_secs());
        let socket = listener.accept(|| {
            if running.child.try_wait()?.is_some() {
                let problem = format!(
                    "{name} ended before it connected: an app needs bevy_frugal_gi's `StagePlugin`, with its feature `stage`"
                );
                return Err(running.describe(&problem));
            }
            if patience.is_some_and(|patience| start.elapsed() > patience) {
                let problem = format!(
                    "{name} did not connect within {waited} s: an app needs bevy_frugal_gi's `StagePlugin`, with its feature `stage`; --patience waits longer"
                );
                return Err(running.describe(&problem));
            }
            Ok(())
        })?;
        socket.set_read_timeout(patience.map(|patience| patience + GRACE))?;
        socket.set_write_timeout(patience)?;
        let mut input = BufReader::new(socket.try_clone()?);
        let hello: Hello = receive(&mut input).map_err(|error| {
            running.describe(&format!("{name} does not speak as a stage: {error}"))
        })?;
        let here = Hello::here();
        if (hello.protocol, &hello.version) != (here.protocol, &here.version) {
            return Err(RemoteError::usage(format!(
                "{name} has bevy_frugal_gi {} (stage protocol {}), this is frugal {} (stage protocol {PROTOCOL}): build both from one version",
                hello.version, hello.protocol, here.version
            )));
        }
        Ok(Self {
            program: program.clone(),
            running,
            input,
            output: socket,
            hello,
            resident_bytes: 0,
        })
    }

    /// Waits for the program's level.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn load(&mut self, scene: bool) -> Result<Loaded, RemoteError> {
        let request = Request::Load { seconds: self.patience_seconds(), scene };
        match self.exchange(&request)? {
            (Answer::Loaded { knobs, opt_in, .. }, scene) => Ok(Loaded { knobs, opt_in, scene }),
            (other, _) => Err(RemoteError::unexpected(&other)),
        }
    }

    /// Longest time for its level, seconds.
    pub(super) fn patience_seconds(&self) -> f64 {
        self.program.patience().map_or(f64::MAX, |patience| patience.as_secs_f64())
    }

    /// Sends a request; returns the answer, and the bytes that follow it.
    ///
    /// # Errors
    /// [`NoAnswer`].
    pub(super) fn exchange(&mut self, request: &Request) -> Result<(Answer, Vec<u8>), NoAnswer> {
        let Self { input, output, .. } = self;
        let reply = send(output, request)
            .and_then(|()| output.flush())
            .and_then(|()| receive::<Reply>(input))
            .and_then(|reply| {
                let count = match reply.answer {
                    Answer::Frame { width, height, .. } => u64::from(width) * u64::from(height) * 3,
                    Answer::Radiance { width, height } => u64::from(width) * u64::from(height) * 12,
                    Answer::Loaded { bytes, .. } => bytes,
                    _ => 0,
                };
                let mut bytes = Vec::new();
                if input.by_ref().take(count).read_to_end(&mut bytes)? as u64 != count {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                Ok((reply, bytes))
            });
        match reply {
            Ok((Reply { answer: Answer::Failed { usage, message }, .. }, _)) => {
                Err(NoAnswer::Failed(RemoteError { usage, message }))
            }
            Ok((Reply { resident_bytes, answer }, bytes)) => {
                self.resident_bytes = resident_bytes;
                Ok((answer, bytes))
            }
            Err(error) => {
                let name = self.program.name();
                if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) {
                    let waited = self.patience_seconds();
                    let problem =
                        format!("{name} hangs: no answer for {waited} s; --patience waits longer");
                    return Err(NoAnswer::Hung(self.running.describe(&problem)));
                }
                let problem =
                    format!("{name} broke off ({error}): it crashed, or ran out of memory");
                Err(NoAnswer::Broken(self.running.describe(&problem)))
            }
        }
    }
}

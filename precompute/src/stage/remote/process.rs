//! One child process: started when it is needed, replaced when it has grown too large or died.

use std::io::{BufReader, Read};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use frugal_core::frontier::CostPoint;
use frugal_core::knobs::KnobLevels;
use frugal_trace::metrics::Picture;
use frugal_trace::scene::CameraPose;

use super::{Answer, Opened, Reply, Request, receive, send};
use crate::stage::{FrameRenderer, RenderedFrame};

/// Resident size above which a child is replaced, bytes. Well above a scene's own textures, well
/// below the memory of a small machine.
const LARGEST_BYTES: u64 = 4 << 30;

/// Name of the child's hidden command.
pub(crate) const CHILD_COMMAND: &str = "stage-worker";

/// Environment variable for the number of threads of the software driver lavapipe; other drivers
/// ignore it.
const LAVAPIPE_THREADS: &str = "LP_NUM_THREADS";

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

    pub(super) fn unexpected(answer: &Answer) -> Self {
        Self::failed(format!("the renderer's process sent an unexpected answer: {answer:?}"))
    }
}

/// A child with its pipes.
struct Worker {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    resident_bytes: u64,
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The child has no state to save.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A stage's child process, running or to be started.
pub(crate) struct StageProcess {
    /// Opens its stage.
    opening: Request,
    /// Threads of a software driver; `None`: as many as it likes.
    threads: Option<usize>,
    worker: Option<Worker>,
    is_warm: bool,
}

impl StageProcess {
    pub(super) fn new(opening: Request, threads: Option<usize>) -> Self {
        Self { opening, threads, worker: None, is_warm: false }
    }

    /// Every child, this and later ones, renders every level of every knob once before anything else.
    /// Starts one where none runs.
    ///
    /// # Errors
    /// When the child fails, or cannot be started.
    pub(super) fn warm(&mut self) -> Result<(), RemoteError> {
        self.is_warm = true;
        match self.worker {
            Some(_) => self.ask(&Request::Warm).map(drop),
            None => self.start().map(drop),
        }
    }

    /// Cost of settings over a clip. Power is the mean of all frames but the first.
    ///
    /// # Errors
    /// When the child fails.
    pub(super) fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<CostPoint, RemoteError> {
        match self.ask(&Request::Measure { clip: clip.to_vec(), settings })? {
            (Answer::Cost(cost), _) => Ok(cost),
            (other, _) => Err(RemoteError::unexpected(&other)),
        }
    }

    /// Starts a child, or a fresh one in place of the last.
    ///
    /// # Errors
    /// When it cannot be started, or its stage cannot be opened.
    pub(super) fn start(&mut self) -> Result<Opened, RemoteError> {
        let program = std::env::current_exe().map_err(RemoteError::failed)?;
        let mut command = Command::new(program);
        command.arg(CHILD_COMMAND).stdin(Stdio::piped()).stdout(Stdio::piped());
        if let Some(threads) = self.threads.filter(|_| std::env::var_os(LAVAPIPE_THREADS).is_none())
        {
            command.env(LAVAPIPE_THREADS, threads.to_string());
        }
        // Only the parent handles the interrupt key: in the same process group it would kill the
        // child in mid-frame.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| {
            RemoteError::failed(format!("cannot start the renderer's process: {error}"))
        })?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(RemoteError::failed("the renderer's process has no pipes"));
        };
        self.worker =
            Some(Worker { child, input, output: BufReader::new(output), resident_bytes: 0 });
        let opened = match self.exchange(&self.opening.clone())? {
            (Answer::Opened(opened), _) => opened,
            (other, _) => return Err(RemoteError::unexpected(&other)),
        };
        if self.is_warm {
            self.exchange(&Request::Warm)?;
        }
        Ok(opened)
    }

    /// Sends a request, after replacing a child that has grown too large; repeats it once with a
    /// fresh child if the child died.
    pub(super) fn ask(
        &mut self,
        request: &Request,
    ) -> Result<(Answer, Option<Picture>), RemoteError> {
        if self.worker.as_ref().is_some_and(|worker| worker.resident_bytes > LARGEST_BYTES) {
            self.worker = None;
        }
        if self.worker.is_none() {
            self.start()?;
            self.prepare(request)?;
        }
        match self.exchange(request) {
            Err(error) if self.worker.is_none() => {
                self.start().map_err(|again| RemoteError {
                    usage: again.usage,
                    message: format!("{error}; then {again}"),
                })?;
                self.prepare(request)?;
                self.exchange(request)
            }
            result => result,
        }
    }

    /// Begins a run at the frame's pose in a fresh child, so that the frame does not pay for first
    /// use of resources.
    fn prepare(&mut self, request: &Request) -> Result<(), RemoteError> {
        if let Request::Play { pose, settings } = *request {
            self.exchange(&Request::Begin { pose, settings })?;
        }
        Ok(())
    }

    fn exchange(&mut self, request: &Request) -> Result<(Answer, Option<Picture>), RemoteError> {
        let Some(worker) = &mut self.worker else {
            return Err(RemoteError::failed("the renderer's process is not running"));
        };
        let reply = send(&mut worker.input, request)
            .and_then(|()| std::io::Write::flush(&mut worker.input))
            .and_then(|()| receive::<Reply>(&mut worker.output))
            .and_then(|reply| {
                let Answer::Frame { width, height, .. } = reply.answer else {
                    return Ok((reply, None));
                };
                let mut bytes = vec![0; width as usize * height as usize * 3];
                worker.output.read_exact(&mut bytes)?;
                let rgb =
                    bytes.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
                Ok((reply, Some((width, height, rgb))))
            });
        match reply {
            Ok((Reply { answer: Answer::Failed { usage, message }, .. }, _)) => {
                Err(RemoteError { usage, message })
            }
            Ok((reply, picture)) => {
                worker.resident_bytes = reply.resident_bytes;
                let picture = picture
                    .map(|(width, height, rgb)| Picture::new(width, height, rgb))
                    .transpose();
                Ok((reply.answer, picture.map_err(RemoteError::failed)?))
            }
            Err(error) => {
                self.worker = None;
                Err(RemoteError::failed(format!(
                    "the renderer's process broke off ({error}): it crashed, or ran out of memory"
                )))
            }
        }
    }
}

impl FrameRenderer for StageProcess {
    type Error = RemoteError;

    fn begin_run(
        &mut self,
        _: &str,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<(), RemoteError> {
        self.ask(&Request::Begin { pose: *pose, settings }).map(drop)
    }

    fn render_frame(
        &mut self,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<RenderedFrame, RemoteError> {
        match self.ask(&Request::Play { pose: *pose, settings })? {
            (Answer::Frame { power, .. }, Some(picture)) => Ok(RenderedFrame { picture, power }),
            (other, _) => Err(RemoteError::unexpected(&other)),
        }
    }
}

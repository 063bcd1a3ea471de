//! The parent: starts the child, sends requests, and replaces a child that has grown too large or
//! died.

use std::io::{BufReader, Read};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use bevy_frugal_gi::power::MeterInfo;
use bevy_frugal_gi::units::Watts;

use super::protocol::{Answer, Reply, Request, StageRequest, receive, send};
use crate::evaluate::{FrameRenderer, Pose, RenderedFrame};
use crate::metrics::Picture;
use crate::scene::{Bounds, CameraPose, RayScene, SceneDescription};
use crate::table::Measure;

/// Resident size above which a child is replaced, bytes. Well above a scene's own textures, well
/// below the memory of a small machine.
const LARGEST_BYTES: u64 = 4 << 30;

/// Name of the child's hidden command.
pub(crate) const CHILD_COMMAND: &str = "stage-worker";

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
    fn failed(message: impl ToString) -> Self {
        Self { usage: false, message: message.to_string() }
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

/// A stage in a child process.
pub(crate) struct RemoteStage {
    request: StageRequest,
    worker: Option<Worker>,
    space: KnobSpace,
    meter: MeterInfo,
    idle: Watts,
    rays: RayScene,
    bounds: Option<Bounds>,
    vertical_fov_degrees: f32,
    warm: bool,
}

impl RemoteStage {
    /// Starts a child with `scene`, which was read from `request.scene`.
    ///
    /// # Errors
    /// When the scene's geometry cannot be read, the child cannot be started, or its stage cannot
    /// be opened.
    pub(crate) fn open(
        scene: &SceneDescription,
        request: StageRequest,
    ) -> Result<Self, RemoteError> {
        let geometry = scene
            .geometry()
            .map_err(|error| RemoteError { usage: true, message: error.to_string() })?;
        let mut stage = Self {
            request,
            worker: None,
            space: KnobSpace::default(),
            meter: MeterInfo {
                name: String::new(),
                provenance: bevy_frugal_gi::power::Provenance::Modelled,
                description: String::new(),
            },
            idle: Watts(0.0),
            rays: RayScene::from_geometry(&geometry),
            bounds: geometry.bounds(),
            vertical_fov_degrees: scene.camera.vertical_fov,
            warm: false,
        };
        stage.start()?;
        Ok(stage)
    }

    /// The knobs on offer.
    pub(crate) fn space(&self) -> &KnobSpace {
        &self.space
    }

    /// The meter's name and provenance.
    pub(crate) fn meter(&self) -> MeterInfo {
        self.meter.clone()
    }

    /// Idle power, as far as the meter covers it.
    pub(crate) fn idle(&self) -> Watts {
        self.idle
    }

    /// Bounding box of the geometry; `None` without geometry.
    pub(crate) fn bounds(&self) -> Option<Bounds> {
        self.bounds
    }

    /// Width and height, pixels.
    pub(crate) fn size(&self) -> [u32; 2] {
        self.request.size
    }

    /// Target frame rate.
    pub(crate) fn frames_per_second(&self) -> f64 {
        self.request.frames_per_second
    }

    /// Triangles for ray queries.
    pub(crate) fn rays(&self) -> &RayScene {
        &self.rays
    }

    /// Vertical field of view in radians, and width ÷ height.
    pub(crate) fn lens(&self) -> (f32, f32) {
        let [width, height] = self.request.size;
        (self.vertical_fov_degrees.to_radians(), width as f32 / height as f32)
    }

    /// Renders every level of every knob once, in this child and in every later one, so that no
    /// metered frame compiles.
    ///
    /// # Errors
    /// When the child fails.
    pub(crate) fn warm(&mut self) -> Result<(), RemoteError> {
        self.warm = true;
        self.ask(&Request::Warm).map(drop)
    }

    fn start(&mut self) -> Result<(), RemoteError> {
        let program = std::env::current_exe().map_err(RemoteError::failed)?;
        let mut command = Command::new(program);
        command.arg(CHILD_COMMAND).stdin(Stdio::piped()).stdout(Stdio::piped());
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
        match self.exchange(&Request::Open(self.request.clone()))? {
            (Answer::Opened { space, meter, idle }, _) => {
                (self.space, self.meter, self.idle) = (space, meter, idle);
            }
            other => {
                return Err(RemoteError::failed(format!(
                    "the renderer's process sent an unexpected answer: {other:?}"
                )));
            }
        }
        if self.warm {
            self.exchange(&Request::Warm)?;
        }
        Ok(())
    }

    /// Sends a request, after replacing a child that has grown too large; repeats it once with a
    /// fresh child if the child died.
    fn ask(&mut self, request: &Request) -> Result<(Answer, Option<Picture>), RemoteError> {
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
        if let Request::Play { position, rotation, settings } = *request {
            self.exchange(&Request::Begin { position, rotation, settings })?;
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

impl Measure for RemoteStage {
    type Error = RemoteError;

    /// Power is the mean of all frames but the first.
    fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<CostPoint, RemoteError> {
        let clip = clip.iter().map(|pose| (pose.position, pose.rotation)).collect();
        match self.ask(&Request::Measure { clip, settings })? {
            (Answer::Cost(cost), _) => Ok(cost),
            other => Err(RemoteError::failed(format!(
                "the renderer's process sent an unexpected answer: {other:?}"
            ))),
        }
    }
}

impl FrameRenderer for RemoteStage {
    type Error = RemoteError;

    fn begin_run(&mut self, _: &str, pose: &Pose, settings: KnobLevels) -> Result<(), RemoteError> {
        self.ask(&Request::Begin { position: pose.position, rotation: pose.rotation, settings })
            .map(drop)
    }

    fn render_frame(
        &mut self,
        pose: &Pose,
        settings: KnobLevels,
    ) -> Result<RenderedFrame, RemoteError> {
        match self.ask(&Request::Play {
            position: pose.position,
            rotation: pose.rotation,
            settings,
        })? {
            (Answer::Frame { power, .. }, Some(picture)) => Ok(RenderedFrame { picture, power }),
            other => Err(RemoteError::failed(format!(
                "the renderer's process sent an unexpected answer: {:?}",
                other.0
            ))),
        }
    }
}

//! One stage's process: started when it is needed, replaced when it has grown too large or died.

use std::sync::Arc;

use bevy_frugal_gi::power::MeterError;
use bevy_frugal_gi::stage::protocol::{Answer, Opened, Request};
use bevy_frugal_gi::stage::{StageError, StageOptions};
use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;
use frugal_trace::metrics::{Picture, Radiance};
use frugal_trace::scene::CameraPose;

use super::connection::{Connection, NoAnswer, unexpected};
use super::program::Program;
use crate::stage::FrameRenderer;
use crate::work_meter::WorkMeter;

/// Resident size above which a process is replaced, bytes. Well above most scenes' own textures, well
/// below the memory of a small machine.
const LARGEST_BYTES: u64 = 4 << 30;
/// The same as a multiple of its size when it was new: an app may have more textures.
const MOST_GROWTH: u64 = 2;

/// A stage's process, running or to be started.
pub(crate) struct StageProcess {
    program: Program,
    options: StageOptions,
    /// Power by settings, where the stage has no meter of its own.
    work: Option<Arc<WorkMeter>>,
    /// Threads of a software driver; `None`: as many as it likes.
    threads: Option<usize>,
    connection: Option<Connection>,
    /// One with its level, which becomes the first.
    loaded: Option<Connection>,
    /// The knobs on offer, once it was opened.
    space: KnobSpace,
    is_warm: bool,
}

impl StageProcess {
    /// `loaded`: a started program that has its level.
    pub(super) fn new(
        program: Program,
        loaded: Option<Connection>,
        options: StageOptions,
        work: Option<Arc<WorkMeter>>,
        threads: Option<usize>,
    ) -> Self {
        Self {
            program,
            options,
            work,
            threads,
            connection: None,
            loaded,
            space: KnobSpace::default(),
            is_warm: false,
        }
    }

    /// Every process, this and later ones, renders every level of every knob once before anything
    /// else. Starts one where none runs.
    ///
    /// # Errors
    /// When it fails, or cannot be started.
    pub(super) fn warm(&mut self) -> Result<(), StageError> {
        self.is_warm = true;
        match self.connection {
            Some(_) => self.ask(&Request::Warm).map(drop),
            None => self.start().map(drop),
        }
    }

    /// Cost of settings over a clip. Power is the mean of all frames but the first.
    ///
    /// # Errors
    /// When the process fails.
    pub(crate) fn measure(
        &mut self,
        clip: &[CameraPose],
        settings: KnobLevels,
    ) -> Result<CostPoint, StageError> {
        match self.ask(&Request::Measure { clip: clip.to_vec(), settings })? {
            (Answer::Measured(measured), _) => {
                Ok(CostPoint::new(self.power(measured.power, settings)?.0, measured.error))
            }
            (other, _) => Err(unexpected(&other)),
        }
    }

    /// One image with settings in words.
    ///
    /// # Errors
    /// When the process fails, or its stage is not of such images.
    pub(crate) fn shoot(&mut self, pose: &CameraPose, settings: &str) -> Result<Shot, StageError> {
        match self.ask(&Request::Shoot { pose: *pose, settings: settings.to_owned() })? {
            (Answer::Frame { width, height, .. }, bytes) => {
                Ok(Shot::Picture(picture(width, height, &bytes)?))
            }
            (Answer::Radiance { width, height }, bytes) => {
                let values = bytes.as_chunks().0.iter().map(|value| f32::from_le_bytes(*value));
                let rgb = values.collect::<Vec<f32>>().as_chunks().0.to_vec();
                Ok(Shot::Radiance(Radiance { width, height, rgb }))
            }
            (other, _) => Err(unexpected(&other)),
        }
    }

    /// Starts a process, or a fresh one in place of the last.
    ///
    /// # Errors
    /// When it cannot be started, or its stage cannot be opened.
    pub(super) fn start(&mut self) -> Result<Opened, StageError> {
        self.options.check()?;
        // The last one first: it may hold much memory.
        self.connection = None;
        let connection = match self.loaded.take() {
            Some(loaded) => loaded,
            None => {
                let mut connection = Connection::open(&self.program, self.threads)?;
                connection.load(false)?;
                connection
            }
        };
        self.connection = Some(connection);
        let opened = match self.exchange(&Request::Open(self.options.clone()))? {
            (Answer::Opened(opened), _) => opened,
            (other, _) => return Err(unexpected(&other)),
        };
        self.space = opened.space.clone();
        if self.is_warm {
            self.exchange(&Request::Warm)?;
        }
        Ok(opened)
    }

    /// Sends a request, after replacing a process that has grown too large; repeats it once with a
    /// fresh one if it died.
    fn ask(&mut self, request: &Request) -> Result<(Answer, Vec<u8>), StageError> {
        let has_grown = |connection: &Connection| {
            is_too_large(connection.resident_bytes, connection.bytes_when_new)
        };
        if self.connection.as_ref().is_none_or(has_grown) {
            self.start()?;
            self.prepare(request)?;
        }
        match self.exchange(request) {
            Err(NoAnswer::Broken(error)) => {
                self.start().map_err(|again| StageError {
                    usage: again.usage,
                    message: format!("{error}; then {again}"),
                })?;
                self.prepare(request)?;
                Ok(self.exchange(request)?)
            }
            result => Ok(result?),
        }
    }

    /// Begins a run at the frame's pose in a fresh process, so that the frame does not pay for first
    /// use of resources.
    fn prepare(&mut self, request: &Request) -> Result<(), StageError> {
        if let Request::Play { pose, settings } = *request {
            self.exchange(&Request::Begin { pose, settings })?;
        }
        Ok(())
    }

    /// Asks the running process, and drops one that will never answer.
    fn exchange(&mut self, request: &Request) -> Result<(Answer, Vec<u8>), NoAnswer> {
        let Some(connection) = &mut self.connection else {
            let message = "the renderer's process is not running";
            return Err(NoAnswer::Failed(StageError::failed(message)));
        };
        let result = connection.exchange(request);
        if matches!(request, Request::Open(_)) {
            connection.bytes_when_new = connection.resident_bytes;
        }
        if matches!(result, Err(NoAnswer::Broken(_) | NoAnswer::Hung(_))) {
            self.connection = None;
        }
        result
    }

    /// The power that the stage has metered, or that of the settings' work.
    fn power(&self, metered: Option<Watts>, settings: KnobLevels) -> Result<Watts, StageError> {
        let Some(work) = &self.work else {
            return metered.ok_or_else(|| StageError::failed("the stage has no meter"));
        };
        let power = work.power(&self.space, settings, self.options.frames_per_second);
        if power.0.is_finite() && power.0 > 0.0 {
            return Ok(power);
        }
        let name = work.info.name.as_str();
        let error = MeterError::broken(name, format!("gave {power} for rendered frames"));
        Err(StageError::failed(error))
    }
}

/// Whether a process of a resident size is to be replaced, by its size when it was new, bytes.
fn is_too_large(now: u64, when_new: u64) -> bool {
    now > LARGEST_BYTES.max(when_new.saturating_mul(MOST_GROWTH))
}

/// One image.
pub(crate) enum Shot {
    /// Display-referred.
    Picture(Picture),
    /// Linear.
    Radiance(Radiance),
}

fn picture(width: u32, height: u32, bytes: &[u8]) -> Result<Picture, StageError> {
    Picture::new(width, height, bytes.as_chunks().0.to_vec()).map_err(StageError::failed)
}

impl FrameRenderer for StageProcess {
    fn begin_run(&mut self, pose: &CameraPose, settings: KnobLevels) -> Result<(), StageError> {
        self.ask(&Request::Begin { pose: *pose, settings }).map(drop)
    }

    fn render_frame(
        &mut self,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<(Picture, Watts), StageError> {
        match self.ask(&Request::Play { pose: *pose, settings })? {
            (Answer::Frame { power, width, height }, bytes) => {
                Ok((picture(width, height, &bytes)?, self.power(power, settings)?))
            }
            (other, _) => Err(unexpected(&other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_replaced_for_what_it_has_grown_by_and_not_for_what_it_is() {
        let gib = |count: u64| count << 30;
        assert!(is_too_large(gib(5), gib(1)) && !is_too_large(gib(4), gib(1)));
        // A level with much in memory would else start anew for each frame.
        assert!(!is_too_large(gib(7), gib(6)) && is_too_large(gib(13), gib(6)));
        assert!(!is_too_large(0, 0) && !is_too_large(u64::MAX, u64::MAX));
    }
}

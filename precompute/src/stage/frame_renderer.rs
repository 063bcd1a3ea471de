//! Consecutive frames, as in an app: what an evaluation plays.

use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_trace::metrics::Picture;
use frugal_trace::scene::CameraPose;

use super::RemoteError;

/// A rendered frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RenderedFrame {
    /// The display-referred image.
    pub picture: Picture,
    /// Power at the target frame rate: idle + this frame's energy × frames per second.
    pub power: Watts,
}

/// Renders and meters frames: a stage, or formulas in tests.
pub(crate) trait FrameRenderer {
    /// Starts a run called `name` at `pose` with `settings`: resets temporal history and warms up,
    /// so that the first frame costs no more than the others. The run's first frame follows.
    ///
    /// # Errors
    /// When the run cannot start.
    fn begin_run(
        &mut self,
        name: &str,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<(), RemoteError>;

    /// Renders the next frame, at `pose` with `settings`. All frames are of one size.
    ///
    /// # Errors
    /// When rendering or metering fails. An unknown power is an error, never 0 W.
    fn render_frame(
        &mut self,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<RenderedFrame, RemoteError>;
}

//! Options of a stage: size, rate, the light that its images show, knobs and meter; and why one cannot be
//! opened or go on.

use std::fmt::Display;
use std::io;

use bevy::math::UVec2;
use serde::{Deserialize, Serialize};

use crate::knobs::KnobSpaceError;

/// Name of a meter that is none: frames have no power.
pub const NO_METER: &str = "none";

/// Format of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Output {
    /// Display-referred: 8-bit sRGB, tone-mapped.
    #[default]
    Display,
    /// Linear radiance in nits, before exposure; without antialiasing and post-processing, which
    /// belong to a display.
    Radiance,
}

/// Component of the light in an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Component {
    /// All light.
    #[default]
    Full,
    /// The renderer's light without global illumination; in a path-traced image, light that at most
    /// one surface scattered.
    Direct,
    /// Indirect light of punctual lights, with Lambertian surfaces; in a path-traced image, light
    /// that two or more surfaces scattered.
    Indirect,
    /// The light that global illumination adds: indirect light, and light of emissive surfaces and
    /// of the sky on other surfaces.
    Global,
}

/// Options of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageOptions {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Target frame rate, which turns energy per frame into power.
    pub frames_per_second: f64,
    /// Format of the output.
    pub output: Output,
    /// Component of the light.
    pub component: Component,
    /// Names of the knobs on offer; `None`: all but the opt-in ones. The others stay at their best.
    pub knobs: Option<Vec<String>>,
    /// The meter's name; `None`: the one that suits the adapter; [`NO_METER`]: none.
    pub meter: Option<String>,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            size: UVec2::new(320, 180),
            frames_per_second: 30.0,
            output: Output::Display,
            component: Component::Full,
            knobs: None,
            meter: None,
        }
    }
}

impl StageOptions {
    /// # Errors
    /// When size or rate is out of range.
    pub fn check(&self) -> Result<(), StageError> {
        // Ambient occlusion needs five mip levels of the view, also at half the resolution. Bevy
        // aborts rendering if the view is too small for them.
        if self.size.min_element() == 0 || !(32..=8192).contains(&self.size.max_element()) {
            return Err(StageError::usage(format!(
                "size {}x{}: must be 32 pixels or more along one side at least, and no more than 8192 along either",
                self.size.x, self.size.y
            )));
        }
        if !(self.frames_per_second.is_finite() && self.frames_per_second > 0.0) {
            let rate = self.frames_per_second;
            let message = format!("frame rate {rate}: must be a finite number above 0");
            return Err(StageError::usage(message));
        }
        Ok(())
    }
}

/// Why an app is no stage, or a frame cannot be rendered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct StageError {
    /// Whether the cause is the input and not the rendering.
    pub usage: bool,
    /// The message.
    pub message: String,
}

impl StageError {
    /// There is neither a GPU nor a software adapter.
    pub const NO_ADAPTER: &str = "no graphics adapter: install a Vulkan driver for the GPU, or a software one (on Debian: apt install mesa-vulkan-drivers), and try again";
    /// The app ended itself.
    pub(super) const ENDED: &str = "the app ended itself";

    /// Invalid input.
    pub fn usage(message: impl ToString) -> Self {
        Self { usage: true, message: message.to_string() }
    }

    /// The rendering failed.
    pub fn failed(message: impl ToString) -> Self {
        Self { usage: false, message: message.to_string() }
    }

    /// A pipeline does not compile or never becomes ready.
    pub(super) fn not_ready(message: impl Display) -> Self {
        Self::failed(format!("the renderer did not become ready: {message}"))
    }
}

impl From<io::Error> for StageError {
    fn from(error: io::Error) -> Self {
        Self::failed(error)
    }
}

impl From<KnobSpaceError> for StageError {
    fn from(error: KnobSpaceError) -> Self {
        Self::usage(error)
    }
}

//! Why an app is no stage, or a frame cannot be rendered.

/// Why an app is no stage, or a frame cannot be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StageError {
    /// There is neither a GPU nor a software adapter.
    #[error(
        "no graphics adapter: install a Vulkan driver for the GPU, or a software one (on Debian: apt install mesa-vulkan-drivers), and try again"
    )]
    NoAdapter,
    /// A size of 0, too small for some of the passes, or larger than a texture can be.
    #[error(
        "size {0}x{1}: must be 32 pixels or more along one side at least, and no more than 8192 along either"
    )]
    Size(u32, u32),
    /// A frame rate that is not above 0 or not finite.
    #[error("frame rate {0}: must be a finite number above 0")]
    FrameRate(f64),
    /// The app cannot show what was asked for.
    #[error("{0}")]
    Level(String),
    /// The app ended itself.
    #[error("the app ended itself")]
    Ended,
    /// An unknown knob.
    #[error(transparent)]
    Knob(#[from] frugal_core::knobs::KnobSpaceError),
    /// The meter.
    #[error(transparent)]
    OpenMeter(#[from] crate::power::OpenMeterError),
    /// A reading.
    #[error(transparent)]
    Meter(#[from] crate::power::MeterError),
    /// The environment map.
    #[error(transparent)]
    Environment(#[from] frugal_trace::scene::SkyError),
    /// A pipeline that does not compile or never becomes ready.
    #[error("the renderer did not become ready: {0}")]
    NotReady(String),
    /// The image could not be read back.
    #[error("the image could not be read back: {0}")]
    ReadBack(String),
    /// The comparison of images.
    #[error(transparent)]
    Compare(#[from] frugal_trace::metrics::SsimError),
}

impl StageError {
    /// Whether the cause is the input and not the rendering.
    pub fn is_usage(&self) -> bool {
        !matches!(
            self,
            Self::Ended | Self::Meter(_) | Self::NotReady(_) | Self::ReadBack(_) | Self::Compare(_)
        )
    }
}

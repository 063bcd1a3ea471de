//! What a search asks of the world: the cost of settings at a camera.

use bevy::math::Vec3;
use bevy_frugal_gi::frontier::{CostPoint, ViewDirection};
use bevy_frugal_gi::knobs::RenderSettings;

/// A camera of the precomputation: an octree corner and one of six view directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleCamera {
    /// World position, metres.
    pub position: Vec3,
    /// Where it looks.
    pub view: ViewDirection,
}

/// Something that knows what settings cost: the headless stage, a recorded table, a synthetic field in tests.
pub trait Evaluate {
    /// Why there is no answer.
    type Error;

    /// Whether `camera` sees anything worth a frontier. False for one inside geometry or before an empty sky; must cost next to nothing.
    ///
    /// # Errors
    /// When it cannot be found out.
    fn sees(&mut self, camera: SampleCamera) -> Result<bool, Self::Error>;

    /// Power and error of `settings` at `camera`.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, Self::Error>;
}

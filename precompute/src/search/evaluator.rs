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

impl SampleCamera {
    /// What tells this camera from others, to the last bit; −0 m is 0 m.
    pub fn key(self) -> CameraKey {
        CameraKey { position: self.position.to_array().map(|metres| (metres + 0.0).to_bits()), view: self.view }
    }
}

/// A [`SampleCamera`] that can be compared, sorted and hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CameraKey {
    /// Bits of the three coordinates.
    pub position: [u32; 3],
    /// Where it looks.
    pub view: ViewDirection,
}

impl<E: Evaluate> Evaluate for &mut E {
    type Error = E::Error;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, E::Error> {
        (**self).sees(camera)
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, E::Error> {
        (**self).evaluate(camera, settings)
    }

    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, E::Error> {
        (**self).refine(camera, settings, so_far)
    }

    fn allowance(&mut self, camera: SampleCamera, proposed: usize) -> Result<usize, E::Error> {
        (**self).allowance(camera, proposed)
    }
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

    /// A better figure for a point that is about to enter a frontier, where a meter is noisy: repeats, longer windows. Asked once for each such point.
    ///
    /// The least of many noisy readings is too low, so a frontier made of first readings flatters itself. By default `so_far` stands.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, Self::Error> {
        let _ = (camera, settings);
        Ok(so_far)
    }

    /// How many evaluations a search at `camera` may take, where a clock proposes `proposed`.
    ///
    /// A clock never says the same twice: what records a run answers here what it recorded, so that a resumed run takes the same path.
    ///
    /// # Errors
    /// When the record cannot be written.
    fn allowance(&mut self, camera: SampleCamera, proposed: usize) -> Result<usize, Self::Error> {
        let _ = camera;
        Ok(proposed)
    }
}

//! What a search asks of the world: the cost of settings.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;

/// Gives the cost of settings: a renderer at one camera, a recorded table, a model.
pub trait Evaluate {
    /// Why there is no cost.
    type Error;

    /// Power and error of `settings`. Costs that are not finite are left out of every frontier.
    ///
    /// # Errors
    /// When the evaluation fails.
    fn evaluate(&mut self, settings: RenderSettings) -> Result<CostPoint, Self::Error>;
}

impl<E: Evaluate> Evaluate for &mut E {
    type Error = E::Error;

    fn evaluate(&mut self, settings: RenderSettings) -> Result<CostPoint, E::Error> {
        (**self).evaluate(settings)
    }
}

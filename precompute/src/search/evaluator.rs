//! The interface of a search: evaluation of settings.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;

/// Evaluates the cost of settings: by a renderer at one camera, a recorded table, or a model.
pub(crate) trait Evaluate {
    /// Why an evaluation failed.
    type Error;

    /// Power and error of `settings`. Costs that are not finite are left out of every frontier.
    ///
    /// # Errors
    /// When the evaluation fails.
    fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, Self::Error>;
}

impl<E: Evaluate> Evaluate for &mut E {
    type Error = E::Error;

    fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, E::Error> {
        (**self).evaluate(settings)
    }
}

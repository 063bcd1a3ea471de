//! The search at one camera alone: screening, then rounds of proposals. The reference for what maps
//! select, and what `frugal search` counts.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use bevy_frugal_gi::units::Watts;

use super::{Proposal, Screening, propose, round_seed, screening_settings};
use crate::cost::{CostModel, CostReading, FrameLayout, Work};
use crate::table::CostTable;

/// A camera at which settings are rendered, or looked up in a table.
pub(crate) trait SearchedCamera {
    /// Why settings cannot be rendered.
    type Error;

    /// Renders those of `settings` that are not known, until the search is done.
    ///
    /// # Errors
    /// When rendering fails.
    fn ask_all(&mut self, settings: Vec<KnobLevels>) -> Result<(), Self::Error>;

    /// One row: all settings that were asked for, in order. Those that cannot be had have no finite
    /// cost.
    fn known(&self) -> &CostTable;

    /// Whether the search has what it wants.
    fn is_done(&self) -> bool;

    /// Settings that were asked for and could be had, with their costs.
    fn readings(&self) -> Vec<(KnobLevels, CostPoint)> {
        let known = self.known();
        known
            .settings()
            .iter()
            .filter_map(|settings| Some((*settings, known.get(0, *settings)?)))
            .collect()
    }
}

/// The knobs that are searched, and the parameters of the work model other than settings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraSearch<'a> {
    /// The knobs.
    pub space: &'a KnobSpace,
    /// Parameters of the work model.
    pub layout: &'a FrameLayout,
    /// Settings proposed per round.
    pub batch: usize,
    /// Seed of the searches on models.
    pub seed: u64,
}

impl CameraSearch<'_> {
    /// Screening and rounds, until the camera is done or nothing is proposed.
    ///
    /// # Errors
    /// When rendering fails.
    pub(crate) fn run<C: SearchedCamera>(&self, camera: &mut C) -> Result<(), C::Error> {
        let screening = self.screen(camera)?;
        for round in 0.. {
            if camera.is_done() || !self.round(&screening, round, camera)? {
                break;
            }
        }
        Ok(())
    }

    /// Single effects of the knobs at the camera.
    ///
    /// # Errors
    /// When rendering fails.
    pub(crate) fn screen<C: SearchedCamera>(&self, camera: &mut C) -> Result<Screening, C::Error> {
        camera.ask_all(screening_settings(self.space, true))?;
        Ok(Screening::of(self.space, camera.known()))
    }

    /// A round of proposals; false if nothing is proposed.
    ///
    /// # Errors
    /// When rendering fails.
    pub(crate) fn round<C: SearchedCamera>(
        &self,
        screening: &Screening,
        round: u64,
        camera: &mut C,
    ) -> Result<bool, C::Error> {
        let readings = camera.readings();
        let reading = |(settings, cost): &(KnobLevels, CostPoint)| CostReading {
            camera: 0,
            work: Work::of(self.space, *settings, self.layout),
            power_w: cost.power.0,
        };
        // One frame rate throughout: idle power may count as the price of a frame.
        let readings_of_work: Vec<_> = readings.iter().map(reading).collect();
        let cost = CostModel::fit(&readings_of_work, Watts(0.0));
        let errors: Vec<_> =
            readings.iter().map(|(settings, cost)| (*settings, cost.error)).collect();
        let proposal = Proposal {
            space: self.space,
            screening,
            cost: &cost,
            layout: self.layout,
            errors: &errors,
        };
        // Settings that cannot be had have no reading, and so are proposed again.
        let missing = camera.known().settings().len() - readings.len();
        let seed = round_seed(self.seed, round);
        let fresh: Vec<_> = propose(&proposal, self.batch + missing, seed)
            .into_iter()
            .filter(|settings| camera.known().column(*settings).is_none())
            .take(self.batch)
            .collect();
        let proposes = !fresh.is_empty();
        camera.ask_all(fresh)?;
        Ok(proposes)
    }
}

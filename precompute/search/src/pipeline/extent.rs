//! Extent of a search: as much as its time limit allows on this machine.

use frugal_core::knobs::KnobSpace;

use super::{PipelineError, Purpose, Renderings, jobs};
use crate::pool::screening_settings;

/// How far a search goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Number of pilot cameras; each proposal is rendered at all of them. Higher values suit the
    /// pool to more kinds of views.
    pub pilots: usize,
    /// Whether screening renders levels between the one below the best and the lowest, too.
    pub all_levels: bool,
    /// Greatest number of rounds of proposals.
    pub rounds: usize,
    /// Settings proposed per round.
    pub batch: usize,
    /// Share of the time limit after which no more settings are proposed.
    pub pool_share: f64,
    /// Greatest number of settings that a map may select. Higher values leave less of a power budget
    /// unused.
    pub pool: usize,
    /// Number of training cameras that render the whole pool. All others render the anchors, from
    /// which the rest follows (`fit::Completion`), so at least three. Higher values are more
    /// accurate, and take longer. Error budgets are calibrated by these alone where there are enough.
    pub full: usize,
    /// Number of anchors. Higher values are more accurate at each camera, and leave time for fewer
    /// cameras.
    pub anchors: usize,
    /// Training cameras between two checks of the time limit.
    pub block: usize,
}

impl Extent {
    /// Without a time limit, and wherever there is time.
    pub const WHOLE: Self = Self {
        pilots: 6,
        all_levels: true,
        rounds: 12,
        batch: 8,
        pool_share: 0.3,
        pool: 32,
        full: 20,
        anchors: 6,
        block: 6,
    };
    /// For some hundred renderings: at six pilots, screening alone would take all of them. Many full
    /// cameras, since completed errors share the prediction's bias.
    const SHORT: Self = Self {
        pilots: 2,
        all_levels: false,
        rounds: 9,
        batch: 6,
        pool_share: 0.4,
        pool: 16,
        full: 12,
        anchors: 5,
        block: 2,
    };
    /// For fewer: rather some cameras with few settings than the reverse, which leaves the way between
    /// cameras unknown.
    const SHORTEST: Self = Self {
        pilots: 1,
        rounds: 2,
        pool_share: 0.55,
        pool: 8,
        full: 9,
        anchors: 4,
        block: 1,
        ..Self::SHORT
    };

    /// Renderings that a search of an extent is worth having for: with fewer it would find a pool and
    /// have no time for cameras.
    const WORTH: [(Self, usize); 2] = [(Self::WHOLE, Self::WHOLE_RENDERINGS), (Self::SHORT, 200)];
    /// Renderings for which there must be time in a whole search.
    pub const WHOLE_RENDERINGS: usize = 1500;

    /// The extent that the time allows, from the duration of the first renderings: those that the
    /// first pilot camera needs in any case.
    pub(super) fn choose(
        space: &KnobSpace,
        first_pilot: Option<usize>,
        renderings: &mut Renderings<'_>,
    ) -> Result<Self, PipelineError> {
        if renderings.setup.limit.is_none() {
            return Ok(Self::WHOLE);
        }
        let settings = screening_settings(space, false);
        let jobs = jobs(Purpose::Training, first_pilot.as_slice(), &settings);
        renderings.batch("screening", &jobs)?;
        for (extent, worth) in Self::WORTH {
            if renderings.has_time(&format!("{worth} renderings"), worth, 1.0)? {
                return Ok(extent);
            }
        }
        Ok(Self::SHORTEST)
    }
}

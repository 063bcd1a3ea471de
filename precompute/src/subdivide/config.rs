//! What to subdivide, how far, and what came of it.

use bevy::math::Vec3;
use bevy_frugal_gi::units::Watts;

use crate::search::SearchConfig;

/// Deepest lattice that an octree's coordinates can carry.
pub(super) const MAX_LEVELS: u8 = 15;

/// The box in which cameras move: the root of the octree. World space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraSpace {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner: above `min` on every axis.
    pub max: Vec3,
}

/// A difference of power that is too large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Threshold {
    /// In watts: 0 or above.
    Absolute(Watts),
    /// As a share (0.05 is 5 %) of the mean power range of the root's frontiers: scenes of all sizes with one figure. Where no frontier has a range,
    /// no setting trades power, and power divides nothing.
    Relative(f64),
}

/// Settings of a subdivision.
#[derive(Clone, Debug, PartialEq)]
pub struct SubdivideConfig {
    /// How often a node can be halved, 0 to 15. Higher values follow finer changes; every level can take eight times the searches.
    pub levels: u8,
    /// Frontiers of adjacent corners that are further apart in power divide the node. Lower values give finer maps and longer runs.
    pub power_threshold: Threshold,
    /// The same for error (1 − SSIM): 0 or above. Wang et al. 2016 used 0.002 to 0.005.
    pub error_threshold: f64,
    /// Evaluations that each camera gets before any gets more, where a clock decides; a run too short for that gives all the same. At least 2.
    pub least_evaluations: usize,
    /// The search at each camera.
    pub search: SearchConfig,
}

impl Default for SubdivideConfig {
    fn default() -> Self {
        Self {
            levels: 4,
            power_threshold: Threshold::Absolute(Watts(0.5)),
            error_threshold: 0.005,
            least_evaluations: 24,
            search: SearchConfig::default(),
        }
    }
}

/// Why there is no map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SubdivideError<E> {
    /// The camera space is empty, flat, or not finite.
    #[error("the camera space from {min} to {max} has no volume: its upper corner must lie above the lower one on every axis", min = .0.min, max = .0.max)]
    Space(CameraSpace),
    /// More levels than coordinates can carry.
    #[error("{0} levels, where at most {MAX_LEVELS} are possible")]
    Levels(u8),
    /// A threshold that is negative or not a number.
    #[error("the {metric} threshold {value} must be 0 or above")]
    Threshold {
        /// Power or error.
        metric: &'static str,
        /// The value as given.
        value: f64,
    },
    /// An evaluation failed.
    #[error("{0}")]
    Evaluate(E),
}

impl SubdivideConfig {
    /// Whether it makes sense, with the space.
    pub(super) fn check<E>(&self, space: CameraSpace) -> Result<(), SubdivideError<E>> {
        if !(space.min.is_finite() && space.max.is_finite() && space.min.cmplt(space.max).all()) {
            return Err(SubdivideError::Space(space));
        }
        if self.levels > MAX_LEVELS {
            return Err(SubdivideError::Levels(self.levels));
        }
        let power = match self.power_threshold {
            Threshold::Absolute(watts) => watts.0,
            Threshold::Relative(share) => share,
        };
        for (metric, value) in [("power", power), ("error", self.error_threshold)] {
            if value.is_nan() || value < 0.0 {
                return Err(SubdivideError::Threshold { metric, value });
            }
        }
        Ok(())
    }
}

/// What a subdivision did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Cameras with a search of their own.
    pub searched: usize,
    /// Cameras that share a parent's frontier, since the parents agree.
    pub inherited: usize,
    /// Cameras that see nothing.
    pub blind: usize,
    /// Cameras that should have been searched, had there been time: they share the nearest searched one's frontier.
    pub unfinished: usize,
    /// Evaluations made.
    pub evaluations: usize,
    /// Evaluations that were known already.
    pub cache_hits: usize,
    /// Frontier points measured again.
    pub refinements: usize,
    /// Pairs of frontiers compared.
    pub comparisons: usize,
    /// Nodes of the octree, leaves included.
    pub nodes: usize,
    /// Corners of the octree.
    pub corners: usize,
    /// Depth of the deepest node: 0 when the root is a leaf.
    pub levels: u8,
    /// Seconds spent in searches.
    pub searching_seconds: f64,
    /// Seconds spent comparing frontiers.
    pub comparing_seconds: f64,
    /// Seconds spent on the final frontiers.
    pub settling_seconds: f64,
    /// Whether neither the clock nor an interrupt cut it short.
    pub complete: bool,
}

//! Pareto frontiers and the map that stores one for every sample camera.

mod conditions;
mod error_rates;
mod estimate;
mod knob_effects;
mod map;
mod map_error;
mod metadata;
mod octree;
mod pareto;
mod pareto_serde;
mod shared_knobs;
mod store;
mod validate;
mod view;
mod view_cube;

pub use conditions::{AppConditions, Comparison, Conditions, MapFit, Misfit, ShownScene};
pub use error_rates::{ErrorRate, ErrorRates};
pub use knob_effects::KnobEffects;
pub use map::FrontierMap;
pub use map_error::FrontierMapError;
pub use metadata::{Bounds, Capture, SceneIdentity, Thresholds, WorkPrices};
pub use octree::{Corner, Leaf, Octree};
pub use pareto::{CostPoint, Frontier, FrontierPoint};
pub use shared_knobs::{SharedKnobs, SharedLevels};
pub use store::{Address, FrontierStore, SampleCamera, SampleRef, address_in, look_up_in};
pub use view::{CUT_DISTANCE, CameraView, ViewDirection, is_cut};

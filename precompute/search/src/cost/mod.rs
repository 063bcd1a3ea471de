//! Cost of a frame: the work of its settings, and a fitted price of each kind of work. Independent
//! of the renderer.
//!
//! Meter readings are noisy, and drift. Work is exact: pixels, VPL–pixel pairs, rays, shadow
//! texels. A model of few prices, fitted to all readings of a run, predicts power better than a
//! reading over two frames does, and also that of settings that were never rendered.
mod model;
mod nnls;
mod plan;
mod reprice;
mod shared;
mod work;

pub use model::{CostModel, CostReading, FitQuality};
pub use plan::ReadingPlan;
pub use reprice::{DeviceModel, NewConditions, price, reprice};
pub(crate) use shared::saved_joules;
use shared::with_shared_knobs;
pub use shared::{SHARED_KNOBS, work_prices};
pub use work::{
    FrameLayout, MAX_VPLS_PER_PIXEL, POINT_LIGHT_MAPS, VISIBILITY_RAYS, Work, work_names,
};

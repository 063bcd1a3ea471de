//! What a frame costs: the work that its settings ask for, and a fitted price of each kind of work.
//! Knows no renderer.
//!
//! Readings of a meter are noisy, and drift. Work is exact: pixels, VPL–pixel pairs, rays, shadow
//! texels. A model of few prices, fitted to all readings of a run, tells the power of settings
//! better than two frames of them do, and of settings that were never rendered.
mod model;
mod nnls;
mod reprice;
mod work;
mod work_meter;

pub use model::{CostModel, CostReading, FitQuality};
pub use reprice::{DeviceModel, NewConditions, RepriceError, reprice};
pub use work::{FrameLayout, Work, work_names};
pub use work_meter::{WORK_METER, WorkLedger, WorkMeter, is_work_meter};

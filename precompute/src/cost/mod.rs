//! Cost of a frame: the work of its settings, and a fitted price of each kind of work. Independent
//! of the renderer.
//!
//! Meter readings are noisy, and drift. Work is exact: pixels, VPL–pixel pairs, rays, shadow
//! texels. A model of few prices, fitted to all readings of a run, predicts the power of settings
//! better than two frames of them, and also that of settings that were never rendered.
mod model;
mod nnls;
mod plan;
mod reprice;
mod shared;
mod work;
mod work_meter;

pub(crate) use model::{CostModel, CostReading, FitQuality};
pub(crate) use plan::ReadingPlan;
pub(crate) use reprice::{DeviceModel, NewConditions, reprice};
use shared::with_shared_knobs;
pub(crate) use shared::{saved_joules, work_prices};
pub(crate) use work::{FrameLayout, Work, work_names};
pub(crate) use work_meter::{WORK_METER, WorkLedger, WorkMeter, is_work_meter};

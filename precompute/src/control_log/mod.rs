//! Statistics of control logs, which apps write: budgets, power, error and switches by run and
//! camera. Independent of the renderer.

mod camera;
mod knobs;

pub(crate) use camera::{CameraLog, cameras};
pub(crate) use knobs::changes;

//! Plays a camera path, renders its record, and checks what is simulated from it.
//!
//! A [`FrameRenderer`](crate::stage::FrameRenderer) renders and meters; a
//! [`Policy`](frugal_search::evaluate::Policy) decides each frame's settings.
//! [`frugal_search::evaluate`] holds what needs no renderer.
//!
//! | part | job |
//! |---|---|
//! | `play` | one run along a path: frame renderer, policy, per-frame records |
//! | `render_path` | makes a record of a path, with several renderers side by side |
//! | `check` | real plays beside the record: errors of simulation, drift, images |
//! | `table` | results as text, and per-frame CSV |
mod check;
#[cfg(test)]
pub(crate) mod fake;
mod play;
mod render_path;
mod table;

pub(crate) use check::{FramePicture, pictures, play_for_real};
pub(crate) use play::{EvaluationError, Progress, plan_along};
pub(crate) use render_path::extend;
pub(crate) use table::{TABLE_HEADERS, frames_csv, headline, notes, table, table_row};

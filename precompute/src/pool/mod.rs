//! The pool: a few dozen settings among which every camera finds what suits it.
//!
//! What one camera teaches helps at all others. [`screening_settings`] lowers every knob alone, at
//! a few pilot cameras; [`propose`] searches models of power and error by NSGA-II for what is worth
//! rendering next; [`portfolio`] keeps the settings that cameras would miss (Xu, Hoos, Leyton-Brown
//! 2010, "Hydra"). Knows no renderer.
mod error_model;
mod portfolio;
mod propose;
mod screening;

pub use error_model::ErrorModel;
pub use portfolio::{portfolio, regret};
pub(crate) use propose::{GREATEST_ERROR, OPTIMISM, model_search, round_seed};
pub use propose::{Proposal, propose};
pub use screening::{Screening, screening_settings};

/// Errors below this look the same.
pub const LEAST_ERROR: f64 = 1e-3;

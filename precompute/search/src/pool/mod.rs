//! The pool: a few dozen settings that suit all cameras between them.
//!
//! Results of one camera carry over to all others. [`screening_settings`] lowers each knob alone,
//! at a few pilot cameras; [`propose`] searches models of power and error by NSGA-II for the
//! settings to render next; [`portfolio`] keeps the settings whose loss would cost cameras most
//! (Xu, Hoos, Leyton-Brown 2010, "Hydra"). Independent of the renderer.
mod error_model;
mod goals;
mod portfolio;
mod propose;
mod screening;

pub(crate) use error_model::ErrorModel;
pub(crate) use portfolio::portfolio;
pub(crate) use propose::{Proposal, propose, round_seed};
pub(crate) use screening::{Screening, screening_settings};

/// Errors below this are visually equal.
pub(crate) const LEAST_ERROR: f64 = 1e-3;

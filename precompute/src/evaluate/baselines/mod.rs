//! Baselines, simulated from a [`PathRecord`](super::PathRecord): constants, oracles, and the
//! reactive ladder that engines ship.
//!
//! | run | information used |
//! |---|---|
//! | `best-constant` | this path: the best constant settings for the budget |
//! | `trained-constant` | other cameras: the best constant settings there |
//! | `oracle` | every frame in advance: a bound, not a method |
//! | `oracle-filtered` | the same, through the controller's temporal filter |
//! | `reactive` | meter readings of earlier frames |
//! | `default` | none: `FrugalGi::default()`, all other knobs at their best |
mod constant;
mod oracle;
mod reactive;

pub(crate) use constant::{best_constant, best_on};
pub(crate) use oracle::{Oracle, oracle};
pub(crate) use reactive::{Reactive, ladder};

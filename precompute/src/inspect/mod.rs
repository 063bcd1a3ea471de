//! Analysis of finished maps: power of two maps at equal error, and presets for a settings menu.
//! Renders nothing.
//!
//! | item | job |
//! |---|---|
//! | [`compare`], [`MapComparison`] | power at equal error, old against new: an energy gate |
//! | [`presets`], [`Presets`] | battery, low, medium, high and ultra, from the shared frontier |
//! | [`comparison_table`], [`presets_table`] | both as text |
mod comparable;
mod compare;
mod presets;
mod table;
#[cfg(test)]
pub(crate) mod testing;

pub(crate) use comparable::CompareError;
pub(crate) use compare::{Change, MapComparison, compare};
pub(crate) use presets::{Presets, presets};
pub(crate) use table::{comparison_table, presets_table};

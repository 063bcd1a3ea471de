//! Power-aware real-time global illumination for Bevy.
pub mod control;
pub mod frontier;
pub mod gi;
pub mod knobs;
pub mod power;
pub mod resolution;
pub mod units;

//! Power meters, each with its provenance.
mod meter;
pub use meter::{MeterError, MeterInfo, PowerMeter, Provenance};

//! Counters and GPU state of global illumination, for apps, tests and debuggers.

mod diagnostics;
#[cfg(feature = "inspect")]
pub mod inspect;

pub use diagnostics::{GiCounts, GiDiagnosticsPlugin};

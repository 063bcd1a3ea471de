//! The harness of the integration tests: scenes on a headless renderer, what they show, and what the GPU holds.
//!
//! Pictures are tiny and settings low: the tests also run on a software adapter.

pub mod golden;
pub mod gpu;
pub mod kernel;
pub mod map;
pub mod meshes;
pub mod set;

//! The harness of the integration tests: scenes on a headless renderer, what they show, and what
//! the GPU holds; and the baseline that the plugin is measured against.
//!
//! Pictures are tiny and settings low: the tests also run on a software adapter.

pub mod arguments;
pub mod cost;
pub mod gather;
pub mod golden;
pub mod gpu;
pub mod kernel;
pub mod map;
pub mod materials;
pub mod meshes;
pub mod method;
pub mod naive_rsm;
pub mod pixels;
pub mod reference;
pub mod set;
pub mod table;

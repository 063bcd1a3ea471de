//! The harness of the integration tests: scenes on a headless renderer, their images and GPU
//! buffers, and the baseline that the plugin is compared with.
//!
//! Images are small and settings low, because the tests also run on a software adapter.

pub mod arguments;
pub mod cost;
pub mod folder;
pub mod gather;
pub mod golden;
pub mod gpu;
pub mod imports;
pub mod kernel;
pub mod map;
pub mod materials;
pub mod meshes;
pub mod method;
pub mod naive_rsm;
pub mod pixels;
pub mod reference;
mod samples;
pub mod set;
pub mod table;

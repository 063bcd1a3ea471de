//! The search behind a frontier map, from cameras to the map, without a renderer, scene files or a
//! command line: [`Measure`](table::Measure) renders.
//!
//! | module | job |
//! |---|---|
//! | [`files`] | output files that are replaced as a whole |
//! | [`journal`] | the append-only file from which a killed run continues |
//! | [`cameras`] | positions of training and calibration cameras |
//! | [`table`] | power and error by camera and settings |
//! | `search` | NSGA-II over a model that gives settings a cost |
//! | [`cost`] | the work of settings, and a fitted price of each kind of work |
//! | `pool` | the few dozen settings that cameras need |
//! | `fit` | frontiers by address, the octree, error budgets |
//! | [`pipeline`] | all of it in order |
//! | [`evaluate`] | policies simulated along a recorded path, and compared |
//!
//! Each module imports only those above it. `linalg` serves all.

pub mod cameras;
pub mod cost;
pub mod evaluate;
pub mod files;
mod fit;
pub mod journal;
mod linalg;
pub mod pipeline;
mod pool;
mod search;
pub mod table;
#[cfg(any(test, feature = "testing"))]
pub mod testing;

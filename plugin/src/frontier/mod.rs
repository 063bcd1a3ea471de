//! Pareto frontiers and the map that holds one for every sample camera.
mod octree;
mod pareto;
mod view;
pub use octree::{Corner, Octree};
pub use pareto::{CostPoint, Frontier, FrontierPoint};
pub use view::{CameraView, ViewDirection};

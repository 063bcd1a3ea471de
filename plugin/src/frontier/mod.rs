//! Pareto frontiers and the map that holds one for every sample camera.
mod pareto;
pub use pareto::{CostPoint, Frontier, FrontierPoint};

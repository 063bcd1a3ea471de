//! Finds one camera's Pareto frontier.
mod evaluator;
pub use evaluator::{Evaluate, SampleCamera};

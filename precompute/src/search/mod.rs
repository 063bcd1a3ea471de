//! Finds the Pareto frontier of anything that gives settings a cost.
//!
//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002) over a
//! [`KnobSpace`](bevy_frugal_gi::knobs::KnobSpace), as Wang et al. 2016, section 3.5.1, use it. The
//! pool is proposed by it on fitted models; on a recorded table it is the baseline that pooling is
//! compared with. Nothing is evaluated twice, single knobs come first (`seeding`), and the last
//! evaluations go where the frontier is sparse (`gaps`).
#[cfg(test)]
mod benchmarks;
mod cached;
mod config;
mod crossover;
mod crowding;
mod evaluator;
mod gaps;
mod level_dominance;
mod mutation;
mod nsga2;
mod seeding;
mod sorting;

pub use config::SearchConfig;
pub use evaluator::Evaluate;
pub use level_dominance::{LevelDominance, level_dominance};
pub use nsga2::{Search, SearchOutcome};

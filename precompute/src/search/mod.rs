//! Searches for the Pareto frontier of an evaluator of settings.
//!
//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002) over a
//! [`KnobSpace`](bevy_frugal_gi::knobs::KnobSpace), as in Wang et al. 2016, section 3.5.1.
//! Proposals for the pool use it on fitted models; on a recorded table it is the baseline for
//! pooling. Nothing is evaluated twice, one-at-a-time screening comes first (`seeding`), and the
//! last evaluations fill in sparse parts of the frontier (`infill`).
#[cfg(test)]
mod benchmarks;
mod cached;
mod config;
mod crossover;
mod crowding;
mod evaluator;
mod infill;
mod level_dominance;
mod mutation;
mod nsga2;
mod seeding;
mod sorting;

pub(crate) use config::SearchConfig;
pub(crate) use evaluator::Evaluate;
pub(crate) use level_dominance::{LevelDominance, level_dominance};
pub(crate) use mutation::random_settings;
pub(crate) use nsga2::Search;
#[cfg(test)]
pub(crate) use nsga2::SearchOutcome;

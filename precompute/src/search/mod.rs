//! Finds one camera's Pareto frontier.
//!
//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002) over a [`KnobSpace`](bevy_frugal_gi::knobs::KnobSpace), as Wang et al. 2016, section 3.5.1, use
//! it, made to be good after few evaluations, because each is a rendering: nothing is evaluated twice ([`Cached`]), neighbours' frontiers or probes
//! of single knobs come first (`seeding`), and the last evaluations go where the frontier is sparse (`gaps`). One operator per file.
#[cfg(test)]
mod benchmarks;
mod cached;
mod config;
mod crossover;
mod crowding;
mod evaluator;
mod gaps;
mod journal;
mod monitor;
mod mutation;
mod nsga2;
mod record;
mod seeding;
mod settle;
mod sorting;
mod worth;

pub use cached::{Cached, Counts};
pub use config::SearchConfig;
pub use evaluator::{CameraKey, Evaluate, SampleCamera};
pub use journal::{Journal, JournalError, JournalHeader, Journaled, JournaledError};
pub use monitor::{Monitor, SearchProgress, Stage, SubdivisionProgress, Unwatched, Watch};
pub use nsga2::{Search, SearchOutcome, SearchTask};
pub use record::knob_space_hash;
pub use settle::settle;
pub use worth::{LevelWorth, level_worth};

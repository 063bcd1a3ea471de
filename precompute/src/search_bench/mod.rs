//! Searches against recorded tables: how many renderings each takes until it knows as good settings
//! as the whole table holds.
//!
//! A table holds every combination of some knobs at one camera, so a search can be run again and
//! again, from any seed, and nothing is rendered. What counts as a rendering is a combination that
//! a search looks up for the first time. The reference image, which each of them needs, does not
//! count. Knows no renderer.
//!
//! | method | what it does |
//! |---|---|
//! | `random` | combinations of the table in random order |
//! | `nsga2` | [`Search`](crate::search::Search), evaluated on the table |
//! | `frugal-cold` | as a map is made: screening, then rounds of proposals on models of power and error |
//! | `frugal-warm` | the same, with what other cameras tell in place of the screening, and under the models |
//!
//! The last two draw at random only where they search their models. Where that finds the models'
//! frontier, all seeds ask for the same settings.

mod frugal;
mod lookup;
mod others;
mod recorded;
mod run;
#[cfg(test)]
mod tests;

pub use recorded::{Recorded, RecordedError};
pub use run::{Goal, GoalResult, Method, MethodResult, SearchRuns, Spread, run};

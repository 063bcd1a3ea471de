//! Search methods on recorded tables: number of renderings until a method's best settings are as
//! good as those of the whole table.
//!
//! A table holds every combination of some knobs at one camera, so searches can be repeated from
//! any seed without rendering. The first look-up of a combination counts as a rendering. The
//! reference image, which all methods need, does not count. Independent of the renderer.
//!
//! | method | description |
//! |---|---|
//! | `random` | combinations of the table in random order |
//! | `nsga2` | [`Search`](crate::search::Search), evaluated on the table |
//! | `frugal-cold` | as in precomputation: screening, then rounds of proposals on models of power and error |
//! | `frugal-warm` | the same, with readings of other cameras in place of the screening, and as the models' prior |
//!
//! The last two are random only in the search of their models. Where that finds the models'
//! frontier, all seeds request the same settings.

mod frugal;
mod lookup;
mod others;
mod recorded;
mod run;
#[cfg(test)]
mod tests;

pub(crate) use recorded::{Recorded, RecordedError};
#[cfg(test)]
pub(crate) use run::Method;
pub(crate) use run::{Goal, MethodResult, SearchRuns, Spread, run};

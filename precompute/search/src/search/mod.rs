//! Search for the Pareto frontier of power and error over the settings of a
//! [`KnobSpace`](frugal_core::knobs::KnobSpace), on models that cost nothing to evaluate.
//!
//! NSGA-II (Deb, Pratap, Agarwal, Meyarivan 2002), as in Wang et al. 2016, section 3.5.1, followed by
//! infill of sparse parts of the frontier.
mod infill;
mod nsga2;
mod ranking;
#[cfg(test)]
mod tests;
mod variation;

pub(crate) use nsga2::Search;
pub(crate) use variation::random_settings;

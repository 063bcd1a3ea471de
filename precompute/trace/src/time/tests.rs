//! Closed forms of times, phases and densities.

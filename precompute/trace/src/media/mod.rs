//! Participating media: homogeneous fog.
//!
//! Radiance, units and lights are those of the rest of the crate; a medium's coefficients are per
//! metre.
//!
//! | module | job |
//! |---|---|
//! | `phase` | directions in which fog scatters |
//! | `fog` | coefficients, bounds and transmittance of a homogeneous medium |
//! | `line` | sampling of distances along a ray through fog |

mod fog;
mod line;
mod phase;

pub use fog::{Distances, Fog, FogError};
pub(crate) use line::{Equiangular, Line};
pub(crate) use phase::{density, sample};

#[cfg(test)]
mod tests;

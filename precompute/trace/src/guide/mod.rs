//! Path guiding: learns from photons, for each place, where much light comes from.
//!
//! | module | job |
//! |---|---|
//! | `sources` | spheres that send much light to a place, and sampling of directions to them |
//! | `field` | places: a tree over positions for each orientation of surfaces |

mod field;
mod sources;

pub(crate) use field::Field;
pub(crate) use sources::{Cones, Photon, around};

#[cfg(test)]
mod tests;

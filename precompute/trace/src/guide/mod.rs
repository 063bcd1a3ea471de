//! Path guiding: learns from photons, for each place, where much light comes from.
//!
//! | module | job |
//! |---|---|
//! | `sphere` | photons, spheres around their sources, and cones of directions to spheres |
//! | `cut` | cuts the sources of a place's photons into spheres |
//! | `sources` | spheres that send much light to a place, and sampling of directions to them |
//! | `field` | places: a tree over positions for each orientation of surfaces |

mod cut;
mod field;
mod sources;
mod sphere;

pub(crate) use field::Field;
pub(crate) use sources::{Cones, around};
pub(crate) use sphere::Photon;

#[cfg(test)]
mod tests;

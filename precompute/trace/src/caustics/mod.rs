//! Caustics: light that mirrors and polished surfaces throw, from photons.
//!
//! Transport is split by the lobes that reflect a path's light. A path is *light–specular* when a
//! specular lobe reflects it first, seen from the light, and a diffuse one later. Those paths are
//! estimated by the density of photons (Jensen 1996, "Global Illumination using Photon Maps"), all
//! others by paths from the camera: each path is counted once, and the sum of the two images is all
//! light. Paths from the camera find light–specular ones rarely, which makes bright dots.
//!
//! Photons cross surfaces from the other end than camera rays. Where a single-sided sheet is seen
//! from behind, the two images cull different faces, and the sum is not exact. For solids it is.
//!
//! | module | job |
//! |---|---|
//! | `split` | settings, and to which of the two images a path belongs |
//! | `map` | photons in a tree: the nearest ones, those within a distance |
//! | `emit` | light–specular photons of the lights |
//! | `gather` | diffuse surfaces that the camera sees, and the light that photons bring them |
//! | `radius` | radii that shrink with the number of photons |
//! | `path` | all other light, along paths from the camera |
//! | `render` | both images |

mod emit;
mod gather;
mod map;
mod path;
mod radius;
mod render;
mod split;

pub use map::{Photon, PhotonMap};
pub use render::{CausticRendering, photon_image, render};
pub use split::{Caustics, Density};

#[cfg(test)]
mod tests;

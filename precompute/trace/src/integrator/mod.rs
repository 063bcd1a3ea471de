//! Light along paths from a camera.
//!
//! Kajiya 1986, "The Rendering Equation", solved by paths from the camera with next-event
//! estimation, multiple importance sampling (Veach and Guibas 1995, "Optimally Combining Sampling
//! Techniques for Monte Carlo Rendering") and Russian roulette. Each module states its differences
//! from Bevy and from other path tracers.
//!
//! | module | job |
//! |---|---|
//! | `settings` | how an image is path-traced |
//! | `scene` | geometry, lights and ray queries |
//! | `view` | a camera's rays |
//! | `scatter` | directions in which a path goes on, guided or not |
//! | `lights` | sampling of emissive triangles and of the sky |
//! | `walk` | one step of a path, from surface to surface |
//! | `path` | radiance along one path |
//! | `media` | light in fog; with the feature `media` |
//! | `photons` | light along paths from the lights |
//! | `gain` | whether a guide pays |
//! | `learn` | what a guide learns from photons before an image |
//! | `render` | a camera's image: sampling of pixels, on all CPU cores |

mod gain;
mod learn;
mod lights;
#[cfg(feature = "media")]
mod media;
mod path;
mod photons;
mod render;
mod scatter;
mod scene;
mod settings;
mod view;
mod walk;

#[cfg(any(feature = "caustics", feature = "media"))]
pub(crate) use lights::per_steradian;
#[cfg(feature = "media")]
pub(crate) use lights::{Sampled, emitter};
#[cfg(any(feature = "caustics", feature = "media"))]
pub(crate) use path::GREATEST_SURVIVAL;
#[cfg(feature = "time")]
pub(crate) use path::{Arrival, Record};
#[cfg(feature = "caustics")]
pub(crate) use path::{CERTAIN_SURFACES, extended, punctual};
#[cfg(any(feature = "caustics", feature = "media"))]
pub(crate) use photons::Emission;
#[cfg(feature = "media")]
pub(crate) use photons::Flight;
#[cfg(feature = "caustics")]
pub(crate) use photons::Start;
#[cfg(feature = "time")]
pub(crate) use render::render_recorded;
#[cfg(feature = "caustics")]
pub(crate) use render::sum;
pub use render::{Rendering, Watch, render};
pub use scene::ReferenceScene;
pub use settings::{Guide, Pixels, Settings, Strategy};
pub use view::{FirstHit, View, surfaces};

#[cfg(test)]
mod tests;

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
//! | `path` | radiance along one path |
//! | `render` | a camera's image: sampling of pixels, on all CPU cores |

mod path;
mod render;
mod scene;
mod settings;

pub use render::{FirstHit, Rendering, View, Watch, render, surfaces};
pub use scene::ReferenceScene;
pub use settings::{Pixels, Settings, Strategy};

#[cfg(test)]
mod tests;

//! The reference for the renderer: a path tracer on the CPU. Plain Rust, without the renderer.
//!
//! Kajiya 1986, "The Rendering Equation", solved by paths from the camera with next-event
//! estimation, multiple importance sampling (Veach and Guibas 1995, "Optimally Combining Sampling
//! Techniques for Monte Carlo Rendering") and Russian roulette. Units are photometric, and lights
//! and materials are Bevy's, so that radiance is comparable nit by nit. Each module states its
//! differences from Bevy and from other path tracers.
//!
//! | module | job |
//! |---|---|
//! | `render` | a camera's image: sampling of pixels, on all CPU cores |
//! | `path` | radiance along one path |
//! | `scene` | geometry, lights and ray queries |
//! | `surface`, `bsdf` | the surface at a hit, and its reflection model |
//! | `lights`, `emitters`, `sky` | punctual lights; emissive triangles; the environment |
//! | `sampler` | random numbers |

mod bsdf;
mod emitters;
mod lights;
mod path;
mod render;
mod sampler;
mod scene;
mod sky;
mod surface;

pub use bsdf::Shading;
pub use path::Strategy;
pub use render::{Pixels, Rendering, Seen, Settings, View, Watch, render, surfaces};
pub use scene::{ReferenceError, ReferenceScene};

use glam::DVec3;

/// Rec. 709.
fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

fn color(rgb: [f32; 3]) -> DVec3 {
    DVec3::from_array(rgb.map(f64::from))
}

#[cfg(test)]
mod tests;

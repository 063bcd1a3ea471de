//! The truth that the renderer is held to: a path tracer on the processor. Plain Rust, no renderer.
//!
//! Kajiya 1986, "The Rendering Equation", solved by paths from the camera with next-event
//! estimation, multiple importance sampling (Veach and Guibas 1995, "Optimally Combining Sampling
//! Techniques for Monte Carlo Rendering") and Russian roulette. Units are photometric and light and
//! materials are Bevy's, so that radiance is comparable nit by nit; what differs from Bevy, and
//! from other path tracers, is said where it is.
//!
//! | module | job |
//! |---|---|
//! | `render` | a camera's image: samples of pixels, on all processors |
//! | `path` | the light along one path |
//! | `scene` | geometry, light and what a ray meets of it |
//! | `surface`, `bsdf` | what is there where a ray meets a triangle, and what it does with light |
//! | `lights`, `emitters`, `sky` | lamps and suns; emissive triangles; the surroundings |
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

use bevy::math::DVec3;

/// Rec. 709.
fn luminance(color: DVec3) -> f64 {
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

fn color(rgb: [f32; 3]) -> DVec3 {
    DVec3::from_array(rgb.map(f64::from))
}

#[cfg(test)]
mod tests;

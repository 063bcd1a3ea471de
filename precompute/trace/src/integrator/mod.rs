//! Light along paths from a camera.
//!
//! Kajiya 1986, "The Rendering Equation", solved by paths from the camera with next-event
//! estimation, multiple importance sampling (Veach and Guibas 1995, "Optimally Combining Sampling
//! Techniques for Monte Carlo Rendering") and Russian roulette. Each module states its differences
//! from Bevy and from other path tracers.
//!
//! | module | job |
//! |---|---|
//! | `scene` | geometry, lights and ray queries |
//! | `view` | a camera's rays |
//! | `walk` | one step of a path, from surface to surface, guided or not |
//! | `path` | radiance along one path; sampling of emissive triangles and of the sky |
//! | `media` | light in fog; with the feature `media` |
//! | `photons` | light along paths from the lights |
//! | `gain` | whether a guide pays |
//! | `learn` | what a guide learns from photons before an image |
//! | `render` | a camera's image: sampling of pixels, on all CPU cores |

mod gain;
mod learn;
#[cfg(feature = "media")]
mod media;
pub(crate) mod path;
pub(crate) mod photons;
pub(crate) mod render;
mod scene;
mod view;
mod walk;

use crate::bsdf::Shading;
pub use render::{Rendering, Watch, render};
pub use scene::ReferenceScene;
pub use view::{FirstHit, View, surfaces};

/// How an image is path-traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Paths per pixel, at least 1. Noise falls with its square root, and faster where light is
    /// smooth; time grows linearly. Powers of two are best.
    pub samples: u32,
    /// Greatest number of indirect bounces; `None` for no limit. 0 is direct light alone. Each
    /// costs one ray or more.
    pub bounces: Option<u32>,
    /// Seed of all random numbers: another seed gives another image with the same mean.
    pub seed: u64,
    /// Reflection model.
    pub shading: Shading,
    /// Sampling strategy for lights with extent.
    pub strategy: Strategy,
    /// Positions of camera rays within a pixel.
    pub pixels: Pixels,
    /// What tells paths where light comes from.
    pub guide: Guide,
}

/// What tells paths where light comes from. All have the same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guide {
    /// Nothing: directions are sampled by BSDF and lights alone.
    #[default]
    None,
    /// Photons, traced before the image: paths branch to where they came from. Less noise where most
    /// light is indirect, the more the fewer and smaller its places are. Those are spheres, or bins of
    /// directions at each place, by which of them gains more in a few paths; neither where neither
    /// would pay. Learning takes up to a fifth of the time of small images.
    Photons,
}

/// Positions of camera rays within a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pixels {
    /// Uniform over the pixel: its value is the mean over its area (box filter).
    #[default]
    Area,
    /// The pixel's centre, as in a renderer without antialiasing: both have the same aliased edges.
    Middle,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples: 256,
            bounces: None,
            seed: 0,
            shading: Shading::default(),
            strategy: Strategy::default(),
            pixels: Pixels::default(),
            guide: Guide::default(),
        }
    }
}

/// How paths sample lights with extent: emissive triangles and sky maps. All strategies have the
/// same mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Both techniques, weighted by the balance heuristic.
    #[default]
    Combined,
    /// Light sampling alone: noisy where a surface is glossy or the light is near.
    Lights,
    /// BSDF sampling alone: noisy where the light is small.
    Scattering,
}

impl Strategy {
    /// Weight of a sample of density `own`, which the other technique samples with density `other`.
    /// Where `other` is 0 the weight is 1.
    pub(crate) fn weight(self, is_light_sample: bool, own: f64, other: f64) -> f64 {
        match self {
            _ if other <= 0.0 => 1.0,
            Self::Combined => own / (own + other),
            Self::Lights => f64::from(u8::from(is_light_sample)),
            Self::Scattering => f64::from(u8::from(!is_light_sample)),
        }
    }
}

#[cfg(test)]
mod tests;

//! A path tracer on the CPU, and metrics of images. Plain Rust, without a renderer, scene files or a
//! command line.
//!
//! Units are photometric (lux, lumens, nits), lengths metres, colours linear Rec. 709, +Y is up.
//! Lights and materials are Bevy's, so that radiance is comparable nit by nit.
//!
//! | module | job |
//! |---|---|
//! | [`scene`] | triangles, materials, textures, sky maps, cameras; ray queries |
//! | [`light`] | punctual lights, emissive triangles, the environment |
//! | [`bsdf`] | the surface at a hit, and its reflection model |
//! | `guide` | places from which much light comes, learned from photons |
//! | `media` | homogeneous fog; with the feature `media` |
//! | [`integrator`] | light along paths, and a camera's image |
//! | `fog_cache` | light of emissive surfaces in fog, from few points (feature `media`) |
//! | `fog_beams` | light in fog from photons' ways through it (feature `media`) |
//! | `caustics` | light that mirrors throw, from photons (feature `caustics`) |
//! | [`metrics`] | images, and differences between two |
//! | `coded` | a rolling shutter under modulated light; with the feature `coded` |
//! | `inverse` | dual images; with the feature `inverse` |
//! | `time` | light by its time of arrival, and a time-of-flight camera; with the feature `time` |
//!
//! Each module imports only those above it; [`integrator`], `fog_cache`, `fog_beams` and `caustics`
//! also [`metrics`]. `color`, `sampler` (random numbers) and `fourier` serve all.
//!
//! # Methods
//!
//! All but the guide are features, off by default. `docs/reference.md` in the repository says what each
//! is for and when not to use it, with measured figures. Examples make them: `guiding`, `caustics`, `fog`
//! (`media`), `beams` (`media`, `time`), `transient` (`caustics`, `time`), `coded`, `dual` (`inverse`).
//!
//! Means agree with Mitsuba 3.9.1 for an area light in a closed room, empty and in fog; light by
//! time agrees with `mitransient` 1.3.1.

pub mod bsdf;
#[cfg(feature = "caustics")]
pub mod caustics;
#[cfg(feature = "coded")]
pub mod coded;
mod color;
#[cfg(feature = "media")]
pub mod fog_beams;
#[cfg(feature = "media")]
pub mod fog_cache;
#[cfg(any(feature = "coded", feature = "inverse"))]
mod fourier;
mod guide;
pub mod integrator;
#[cfg(feature = "inverse")]
pub mod inverse;
pub mod light;
#[cfg(feature = "media")]
pub mod media;
pub mod metrics;
mod sampler;
pub mod scene;
#[cfg(test)]
mod testing;
#[cfg(feature = "time")]
pub mod time;

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
//! | `caustics` | light that mirrors throw, from photons (feature `caustics`) |
//! | [`metrics`] | images, and differences between two |
//! | `coded` | a rolling shutter under modulated light; with the feature `coded` |
//! | `inverse` | dual images, and sources found from their light; with the feature `inverse` |
//! | `time` | light by its time of arrival, and a time-of-flight camera; with the feature `time` |
//!
//! Each module imports only those above it, [`integrator`] and `caustics` also [`metrics`]. `color`,
//! `sampler` (random numbers) and `fourier` serve all.
//!
//! # Methods
//!
//! Features are off by default. The examples of the same names measure them.
//!
//! | method | use it for | do not use it for |
//! |---|---|---|
//! | [`Guide::Photons`](integrator::Guide::Photons) | rooms that one lit spot lights, lights behind shades: 2 to 3.7 times less squared error in equal time | open scenes, and doors ajar: 0.6 to 1.1 times |
//! | `caustics` | light that metal throws onto matte surfaces, where paths leave bright dots | scenes without polished metal: photons find nothing to do |
//! | `media` | fog in the reference image | fog in `time`: paths in fog carry no lengths |
//! | `time` | transient images; what multipath does to a time-of-flight camera | still images: the same picture for more memory |
//! | `coded` | stripes that blinking lights draw in a rolling shutter, and codes in them | cameras with a global shutter |
//! | `inverse` | tests of light transport: dual images, sources from the light they leave | pictures |
//!
//! Densities of caustics: the nearest 50 photons up to 100,000 of them, radii that adapt to the
//! photons above.
//!
//! Mitsuba 3.9.1 has the same means within 0.15 % for an area light in a closed room, empty and in three
//! fogs, and `mitransient` 1.3.1 the same light by nanosecond within noise.

pub mod bsdf;
#[cfg(feature = "caustics")]
pub mod caustics;
#[cfg(feature = "coded")]
pub mod coded;
mod color;
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
#[cfg(feature = "time")]
pub mod time;

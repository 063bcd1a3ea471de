//! Caustics by their time of arrival, from photons.
//!
//! Jarabo et al. 2014, "A Framework for Transient Rendering", section 4.2: the density of photons in
//! space and time, with kernels that shrink from pass to pass.

use super::film::{Film, Frames, Spread, TimeError, Window, narrowed, positive, validate};
use crate::caustics::{Caustics, recorded};
use crate::integrator::{ReferenceScene, Settings, View, Watch};
use crate::metrics::Radiance;

/// How many photons, and how wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photons {
    /// Photons of each pass. Noise falls with the root of their number, time and memory grow linearly.
    pub photons: u32,
    /// Radius of the first pass, metres, finite and above 0. Higher values blur edges more, and have
    /// less noise.
    pub radius: f64,
    /// As [`Caustics::roughness`].
    pub roughness: f32,
}

/// Share of the first pass's radius and bandwidth that pass number `pass`, from 0, has in
/// [`caustics`]. In logarithms each of the three dimensions takes a third of what the volume of the
/// kernel loses.
pub fn shrinking(pass: u32) -> f64 {
    // α = 4/7: error² falls fastest, as passes^(−4/7).
    narrowed(4.0 / 7.0, 1.0 / 3.0, pass)
}

/// Light–specular paths, as in [`caustics`](crate::caustics), in a steady image and in a time-resolved
/// one from the same photons, in `settings.samples` passes. The sum of bins over time is the steady
/// image; with [`Spread::Kernel`], bandwidth of the first pass, values converge to those at the frames'
/// middles. `settings.guide` is not used.
///
/// # Errors
/// When the window, the bandwidth or the radius is out of range, or `watch` interrupts.
pub fn caustics(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    Photons { photons, radius, roughness }: Photons,
    window: Window,
    spread: Spread,
    watch: Watch,
) -> Result<(Radiance, Frames), TimeError> {
    validate(window, spread)?;
    positive(radius)?;
    let of = Caustics { photons, roughness, ..Caustics::default() };
    let radii = (0..).map(|pass| radius * shrinking(pass));
    let film = || Film::new(window, spread, shrinking);
    let (image, films) =
        recorded(scene, view, settings, &of, radii, watch, film).ok_or(TimeError::Interrupted)?;
    // A pass that is dropped is dark.
    Ok((image, Frames::new(view, window, films, |_| settings.samples)))
}

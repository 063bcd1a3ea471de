//! Light in fog by its time of arrival, from beams.
//!
//! Marco et al. 2019, "Progressive Transient Photon Beams": each beam and each camera's ray knows
//! how far its light went, and what they exchange arrives at one time.

use super::film::{Film, Frames, Spread, TimeError, Window, narrowed, positive, validate};
use crate::fog_beams::{radii, recorded};
use crate::integrator::{ReferenceScene, Settings, View, Watch};
use crate::metrics::Radiance;

/// How many beams, and how wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beams {
    /// Photons of each pass, at least 1. Noise falls with the root of their number, time and memory
    /// grow linearly.
    pub photons: u32,
    /// Radius of the first pass, metres, finite and above 0. Higher values blur edges more, and have
    /// less noise.
    pub radius: f64,
}

/// Share of the first pass's radius and bandwidth that pass number `pass`, from 0, has in
/// [`beams`] with kernels.
pub fn narrowing(pass: u32) -> f64 {
    // Radius × bandwidth keeps α = 2/3 of its share: error² falls fastest, as passes^(−2/3).
    narrowed(2.0 / 3.0, 1.0 / 2.0, pass)
}

/// Light that fog scatters towards the camera: the image of
/// [`fog_beams::render`](crate::fog_beams::render), and the time-resolved one from the same photons,
/// in `settings.samples` passes. With [`Spread::Bins`] the steady image is that of `fog_beams` bit by
/// bit, and the sum over time of the other; with [`Spread::Kernel`], bandwidth of the first pass,
/// radius and bandwidth shrink by [`narrowing`], and values converge to those at the frames' middles.
/// Bins are the better choice where light comes in short flashes, as a spot's that fog scatters once;
/// kernels where few beams reach each frame, as through a slit.
///
/// Memory: as of [`frames`](super::frames), and 56 bytes for each beam that a pixel sees in a pass.
///
/// # Errors
/// When the window, the bandwidth or the radius is out of range, the scene has no fog, or `watch`
/// interrupts.
pub fn beams(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    Beams { photons, radius }: Beams,
    window: Window,
    spread: Spread,
    watch: Watch,
) -> Result<(Radiance, Frames), TimeError> {
    validate(window, spread)?;
    positive(radius)?;
    if scene.fog.is_none() {
        return Err(TimeError::NoFog);
    }
    let film = || Film::new(window, spread, narrowing);
    let radii: Box<dyn Iterator<Item = f64>> = match spread {
        Spread::Bins => Box::new(radii(radius)),
        Spread::Kernel(_) => Box::new((0..).map(|pass| radius * narrowing(pass))),
    };
    let (image, films) = recorded(scene, view, settings, photons, radii, watch, &film)
        .ok_or(TimeError::Interrupted)?;
    // A pass that is dropped is dark.
    Ok((image, Frames::new(view, window, films, |_| settings.samples)))
}

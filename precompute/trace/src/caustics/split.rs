//! Settings, and which paths photons bring.

use glam::DVec3;

use crate::bsdf::{Bsdf, Lobes, Surface};
use crate::color::luminance;
use crate::sampler::Sampler;

/// How caustics are estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Caustics {
    /// Photons that leave lights, over all passes. With 0 the photons' image is black.
    pub photons: u32,
    /// Greatest perceptual roughness, in [0, 1], of lobes that count as specular; where it is
    /// negative or NaN, none does, and all light is path-traced.
    pub roughness: f32,
    /// Most diffuse surfaces of a light–specular path, at least 1. 1 is caustics themselves; more is
    /// also the light that they send on.
    pub deposits: u32,
    /// How density is estimated.
    pub density: Density,
}

/// How the density of photons is estimated, with a kernel that is constant within a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Density {
    /// As far as the nearest photons reach.
    Nearest {
        /// Their number, at least 2. More are smoother, and blur more.
        count: u32,
    },
    /// The mean of passes whose radius shrinks by a fixed schedule (Knaus and Zwicker 2011,
    /// "Progressive Photon Mapping: A Probabilistic Approach", equation 15). Converges.
    Progressive {
        /// Number of passes, at least 1, which share the photons.
        passes: u32,
        /// Photons of the first pass that the first radius reaches to, at least 2.
        first: u32,
        /// In (0, 1): how much of the density's noise is kept, and how fast blur goes; 2/3 is best.
        alpha: f32,
    },
    /// The mean of passes whose radius shrinks by the photons found (Hachisuka, Ogaki and Jensen
    /// 2008, "Progressive Photon Mapping", equation 7), which is slow where few are.
    Counted {
        /// As above.
        passes: u32,
        /// As above.
        first: u32,
        /// As above.
        alpha: f32,
    },
    /// The mean of passes whose radius balances noise and blur, from estimates of both (Kaplanyan
    /// and Dachsbacher 2013, "Adaptive Progressive Photon Mapping", section 4). Converges.
    Adaptive {
        /// As above.
        passes: u32,
        /// As above.
        first: u32,
    },
}

impl Default for Caustics {
    fn default() -> Self {
        Self {
            photons: 1 << 20,
            roughness: 0.25,
            deposits: 1,
            density: Density::Nearest { count: 50 },
        }
    }
}

/// Light that one part of a BSDF reflects in a sampled direction.
pub(super) struct Reflected {
    /// Unit length.
    pub(super) direction: DVec3,
    /// BSDF of that part ÷ the probability of choosing it.
    pub(super) bsdf: DVec3,
    /// Cosine between direction and shading normal, above 0.
    pub(super) cosine: f64,
    /// Density of the direction, per steradian.
    pub(super) density: f64,
    /// Whether it is the specular part.
    pub(super) is_specular: bool,
}

impl Caustics {
    /// Whether the specular lobe of `surface` counts as specular: rougher ones count as diffuse.
    pub(super) fn is_specular(&self, surface: &Surface) -> bool {
        surface.perceptual_roughness <= f64::from(self.roughness)
    }

    /// Whether photons bring the light that a specular lobe reflects into a path which had
    /// `diffuse` diffuse surfaces so far.
    pub(super) fn brings(&self, diffuse: u32) -> bool {
        (1..=self.deposits.max(1)).contains(&diffuse)
    }

    /// The lobes for light from `direction`, with specular ones that count as diffuse among the
    /// diffuse; `None` where nothing is reflected.
    pub(super) fn lobes(&self, bsdf: &Bsdf, surface: &Surface, direction: DVec3) -> Option<Lobes> {
        let lobes = bsdf.lobes(direction)?;
        Some(if self.is_specular(surface) {
            lobes
        } else {
            Lobes { diffuse: lobes.diffuse + lobes.specular, specular: DVec3::ZERO, ..lobes }
        })
    }

    /// A direction by the whole BSDF, and only then which part reflects the light, in proportion to
    /// the parts: this costs no variance but that of their colours. `None` where nothing is
    /// reflected.
    pub(super) fn sample(
        &self,
        bsdf: &Bsdf,
        surface: &Surface,
        sampler: &mut Sampler,
    ) -> Option<Reflected> {
        let direction = bsdf.sample(sampler)?.direction;
        let Lobes { diffuse, specular, cosine, density } = self.lobes(bsdf, surface, direction)?;
        let sum = luminance(diffuse) + luminance(specular);
        if !(sum > 0.0 && sum.is_finite()) {
            return None;
        }
        let share = luminance(specular) / sum;
        let is_specular = sampler.number() < share;
        let bsdf = if is_specular { specular / share } else { diffuse / (1.0 - share) };
        Some(Reflected { direction, bsdf, cosine, density, is_specular })
    }

    /// Whether `surface` has no diffuse part.
    pub(super) fn is_mirror(&self, bsdf: &Bsdf, surface: &Surface) -> bool {
        self.is_specular(surface) && bsdf.is_only_specular()
    }
}

//! The surface at a hit, and its reflection model: Bevy's `StandardMaterial`, and a Lambertian reflector.
//!
//! Diffuse: Burley 2012, "Physically Based Shading at Disney", section 5.3, with Bevy's use of it
//! (its roughness is the squared one). Specular: Walter et al. 2007, "Microfacet Models for
//! Refraction through Rough Surfaces" (GGX); Heitz 2014, "Understanding the Masking-Shadowing
//! Function in Microfacet-Based BRDFs", equation 99 (height-correlated Smith); Schlick 1994 on the
//! angle to the half vector.
//!
//! Differences from Bevy: there is no compensation for the energy that single scattering between
//! facets loses (Bevy scales the lobe by a fitted factor: within 2 % for dielectrics, more for
//! rough metals). As in Bevy, the diffuse lobe is not reduced by the specular reflectance, so that
//! a white dielectric reflects more than it receives: 3 % with a perceptual roughness of 0.5, 8 % with 1.
//! All bounces in a closed room of it have no limit.

mod surface;

use std::f64::consts::{FRAC_1_PI, TAU};

use glam::DVec3;

use crate::color::luminance;
use crate::sampler::Sampler;
pub(crate) use surface::{Surface, is_cut_out};

/// Least perceptual roughness, as Bevy's.
const LEAST_PERCEPTUAL_ROUGHNESS: f64 = 0.089;
/// Least cosine between normal and view, as Bevy's: interpolated normals may face away from the
/// viewer.
const LEAST_VIEW_COSINE: f64 = 1e-4;
/// Least probability of sampling either lobe where both reflect: the estimate of their shares is
/// rough.
const LEAST_LOBE_SHARE: f64 = 0.1;

/// The reflection model of all surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// Bevy's model: Burley diffuse and GGX specular.
    #[default]
    Standard,
    /// Lambertian, with the albedo base colour × (1 − metallic) and no specular lobe: the model of
    /// virtual point lights.
    Lambertian,
}

/// The reflection model at one point, for one outgoing direction.
pub(crate) struct Bsdf {
    /// Tangent, bitangent and shading normal, orthonormal.
    frame: [DVec3; 3],
    geometric_normal: DVec3,
    /// Direction to the viewer in `frame` coordinates; the third component is above 0.
    view: DVec3,
    /// Diffuse reflectance.
    diffuse: DVec3,
    /// Specular reflectance at normal incidence.
    f0: DVec3,
    /// Squared perceptual roughness.
    alpha: f64,
    shading: Shading,
    /// Probability that [`sample`](Self::sample) takes the specular lobe.
    specular_share: f64,
}

/// The BSDF for one direction, by lobes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobes {
    /// BSDF of the diffuse lobe.
    pub(crate) diffuse: DVec3,
    /// BSDF of the specular lobe.
    pub(crate) specular: DVec3,
    /// Cosine between direction and shading normal, above 0.
    pub(crate) cosine: f64,
    /// Density with which the direction is sampled, per steradian.
    pub(crate) density: f64,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BsdfSample {
    /// Unit length, pointing away from the surface.
    pub(crate) direction: DVec3,
    /// BSDF × cosine ÷ density.
    pub(crate) weight: DVec3,
    /// Probability density, per steradian.
    pub(crate) density: f64,
}

impl Bsdf {
    /// The model of `surface` for the direction `outgoing`, a unit vector.
    pub(crate) fn new(surface: &Surface, outgoing: DVec3, shading: Shading) -> Self {
        let (tangent, bitangent) = surface.normal.any_orthonormal_pair();
        let frame = [tangent, bitangent, surface.normal];
        let view = DVec3::from_array(frame.map(|axis| axis.dot(outgoing)));
        let view = view.with_z(view.z.max(LEAST_VIEW_COSINE)).normalize();
        let metallic = surface.metallic;
        let reflectance = f64::from(surface.material.reflectance);
        let roughness = surface.perceptual_roughness.clamp(LEAST_PERCEPTUAL_ROUGHNESS, 1.0);
        let f0 = match shading {
            Shading::Standard => {
                DVec3::splat(0.16 * reflectance * reflectance * (1.0 - metallic))
                    + surface.base_color * metallic
            }
            Shading::Lambertian => DVec3::ZERO,
        };
        let diffuse = surface.base_color * (1.0 - metallic);
        let geometric_normal = surface.geometric_normal;
        let mut bsdf = Self {
            frame,
            geometric_normal,
            view,
            diffuse,
            f0,
            alpha: roughness * roughness,
            shading,
            specular_share: 0.0,
        };
        let (specular, diffuse) = (luminance(bsdf.fresnel(view.z)), luminance(diffuse));
        bsdf.specular_share = match (specular > 0.0, diffuse > 0.0) {
            (true, true) => {
                (specular / (specular + diffuse)).clamp(LEAST_LOBE_SHARE, 1.0 - LEAST_LOBE_SHARE)
            }
            (only_specular, _) => f64::from(u8::from(only_specular)),
        };
        bsdf
    }

    /// BSDF × cosine for light from `direction`, a unit vector; and the density, per steradian,
    /// with which [`sample`](Self::sample) takes that direction. Both are 0 below the shading
    /// normal's horizon and below the triangle's.
    pub(crate) fn evaluate(&self, direction: DVec3) -> (DVec3, f64) {
        self.lobes(direction).map_or((DVec3::ZERO, 0.0), |lobes| {
            ((lobes.diffuse + lobes.specular) * lobes.cosine, lobes.density)
        })
    }

    /// The parts of [`evaluate`](Self::evaluate); `None` where it is 0.
    pub(crate) fn lobes(&self, direction: DVec3) -> Option<Lobes> {
        let light = DVec3::from_array(self.frame.map(|axis| axis.dot(direction)));
        // This form also rejects NaN.
        let above = light.z > 0.0 && direction.dot(self.geometric_normal) > 0.0;
        if !above {
            return None;
        }
        let half = (self.view + light).normalize();
        let cosine = light.dot(half).clamp(0.0, 1.0);
        let diffuse = match self.shading {
            Shading::Lambertian => self.diffuse * FRAC_1_PI,
            Shading::Standard => self.diffuse * (self.burley(light.z, cosine) * FRAC_1_PI),
        };
        let mut specular = DVec3::ZERO;
        let mut density = (1.0 - self.specular_share) * light.z * FRAC_1_PI;
        if self.specular_share > 0.0 {
            let facets = self.distribution(half.z);
            specular = self.fresnel(cosine) * (facets * self.visibility(light.z));
            density += self.specular_share * facets
                / (2.0 * (self.view.z + self.slope_length(self.view.z)));
        }
        Some(Lobes { diffuse, specular, cosine: light.z, density })
    }

    /// Whether it reflects by the specular lobe alone.
    #[cfg(feature = "caustics")]
    pub(crate) fn is_only_specular(&self) -> bool {
        self.specular_share >= 1.0
    }

    /// Samples a direction, approximately in proportion to BSDF × cosine; `None` where the sample
    /// falls below the surface or nothing is reflected.
    pub(crate) fn sample(&self, sampler: &mut Sampler) -> Option<BsdfSample> {
        let (lobe, pair) = (sampler.number(), sampler.pair());
        let local = if lobe < self.specular_share {
            self.sample_specular(pair)
        } else {
            sample_cosine(pair)
        };
        let direction =
            (self.frame[0] * local.x + self.frame[1] * local.y + self.frame[2] * local.z)
                .normalize();
        let (reflected, density) = self.evaluate(direction);
        (density > 0.0 && reflected.max_element() > 0.0).then(|| BsdfSample {
            direction,
            weight: reflected / density,
            density,
        })
    }

    /// Heitz 2018, "Sampling the GGX Distribution of Visible Normals", listing 1, for an isotropic
    /// lobe; then the mirror direction about that normal.
    fn sample_specular(&self, [u1, u2]: [f64; 2]) -> DVec3 {
        let stretched =
            DVec3::new(self.alpha * self.view.x, self.alpha * self.view.y, self.view.z).normalize();
        let first = DVec3::new(-stretched.y, stretched.x, 0.0).normalize_or(DVec3::X);
        let second = stretched.cross(first);
        let (radius, angle) = (u1.sqrt(), TAU * u2);
        let along = radius * angle.cos();
        let lift = 0.5 * (1.0 + stretched.z);
        let across =
            (1.0 - lift) * (1.0 - along * along).max(0.0).sqrt() + lift * radius * angle.sin();
        let outward = (1.0 - along * along - across * across).max(0.0).sqrt();
        let normal = first * along + second * across + stretched * outward;
        let half = DVec3::new(self.alpha * normal.x, self.alpha * normal.y, normal.z.max(1e-9))
            .normalize();
        half * (2.0 * self.view.dot(half)) - self.view
    }

    fn burley(&self, light_cosine: f64, half_cosine: f64) -> f64 {
        let f90 = 0.5 + 2.0 * self.alpha * half_cosine * half_cosine;
        let scatter = |cosine: f64| 1.0 + (f90 - 1.0) * (1.0 - cosine).powi(5);
        scatter(light_cosine) * scatter(self.view.z.min(1.0))
    }

    /// Specular reflectance of a facet. Below 2 % at normal incidence Bevy also reduces the grazing
    /// reflectance, so that an `f0` of 0 reflects nothing.
    fn fresnel(&self, half_cosine: f64) -> DVec3 {
        let f90 = (self.f0.element_sum() * 50.0 * 0.33).clamp(0.0, 1.0);
        self.f0 + (DVec3::splat(f90) - self.f0) * (1.0 - half_cosine).clamp(0.0, 1.0).powi(5)
    }

    /// GGX distribution of normals, per steradian.
    fn distribution(&self, half_z: f64) -> f64 {
        let scaled = half_z * self.alpha;
        let k = self.alpha / ((1.0 - half_z * half_z).max(0.0) + scaled * scaled);
        k * k * FRAC_1_PI
    }

    /// Height-correlated Smith shadowing ÷ (4 cosθ cosθ′).
    fn visibility(&self, light_z: f64) -> f64 {
        0.5 / (light_z * self.slope_length(self.view.z) + self.view.z * self.slope_length(light_z))
    }

    fn slope_length(&self, cosine: f64) -> f64 {
        let squared = self.alpha * self.alpha;
        (squared + (1.0 - squared) * cosine * cosine).sqrt()
    }
}

/// Density ∝ cosine to the third axis (Malley's method: a disc projected up to the hemisphere).
fn sample_cosine([u1, u2]: [f64; 2]) -> DVec3 {
    let (radius, angle) = (u1.sqrt(), TAU * u2);
    DVec3::new(radius * angle.cos(), radius * angle.sin(), (1.0 - u1).max(0.0).sqrt())
}

#[cfg(test)]
mod tests;

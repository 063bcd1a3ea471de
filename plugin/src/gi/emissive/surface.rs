//! An emissive surface as texels, each for a piece of it: plain Rust, no renderer.
//!
//! Texels are sampled from the surface's points at equal steps of power. So a surface keeps its
//! texels while it or anything else moves, texels lie where a texture is bright, and consecutive
//! texels, among which VPLs are sampled, spread over the surface.

use bevy::math::{Affine3A, DVec3, Mat3A, Vec3};

use crate::gi::surfaces::{Sides, SurfacePoint, SurfacePoints, area_matrix};
use crate::gi::texels::Texel;

/// Largest flux of a texel, lumens, with which sums over all texels stay finite. The same bound
/// holds for VPLs in `vpl/vpl.wgsl`.
const MAX_FLUX: f64 = 1e25;

/// An emissive surface as points with their emissive colour: linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EmissiveSurface(pub SurfacePoints<Vec3>);

impl EmissiveSurface {
    /// Number of candidate points.
    pub(crate) fn len(&self) -> usize {
        self.0.points.len()
    }

    /// Luminous flux of one side in lumens (its luminance) at radiance `emission` (nits, linear
    /// RGB, times the texture's colour), transformed by `affine`.
    pub(crate) fn power(&self, affine: &Affine3A, emission: DVec3) -> f64 {
        let spread = area_matrix(affine);
        self.0.points.iter().map(|point| self.weight(point, &spread, emission)).sum::<f64>()
            * std::f64::consts::PI
    }

    /// Area × luminance of a point's piece of the surface.
    fn weight(&self, point: &SurfacePoint<Vec3>, spread: &Mat3A, emission: DVec3) -> f64 {
        self.0.area
            * f64::from((*spread * point.normal).length())
            * luminance(emission * point.sample.as_dvec3())
    }

    /// Adds `count` texels for each emissive side. Their total flux is the surface's: exactly in
    /// luminance, and in each channel as far as its colour is uniform.
    pub(crate) fn add_texels(
        &self,
        affine: &Affine3A,
        emission: DVec3,
        sides: Sides,
        count: usize,
        texels: &mut Vec<Texel>,
    ) {
        let spread = area_matrix(affine);
        let weights: Vec<f64> =
            self.0.points.iter().map(|point| self.weight(point, &spread, emission)).collect();
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return;
        }
        let step = total / count as f64;
        let (mut index, mut passed) = (0, weights[0]);
        for number in 0..count {
            // An offset within the step, so that no target falls on the border of two points of
            // equal weight, where rounding would decide.
            let target = (number as f64 + 0.381_966) * step;
            while passed <= target && index + 1 < weights.len() {
                index += 1;
                passed += weights[index];
            }
            let point = &self.0.points[index];
            let radiance = emission * point.sample.as_dvec3();
            // The piece's area: `step` is area × luminance.
            let area = step / luminance(radiance);
            let flux = (radiance * (area * std::f64::consts::PI)).min(DVec3::splat(MAX_FLUX));
            let (position, normal) = (
                affine.transform_point3(point.position),
                (spread * point.normal).normalize_or_zero(),
            );
            if !(area.is_finite()
                && flux.is_finite()
                && position.is_finite()
                && normal != Vec3::ZERO)
            {
                continue;
            }
            let texel =
                |sign: &f32| Texel::new(position, area as f32, flux.as_vec3(), normal * *sign);
            texels.extend(sides.signs().iter().map(texel));
        }
    }
}

fn luminance(color: DVec3) -> f64 {
    // Rec. 709.
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;

//! A glowing surface as texels that each stand for a piece of it: plain Rust, no renderer.
//!
//! Texels are drawn from the surface's points at equal steps of power. So the same surface keeps
//! its texels while it or anything else moves, they lie where a texture is bright, and drawing from
//! consecutive ones, as virtual point lights are, spreads over the surface.

use bevy::math::{Affine3A, DVec3, Mat3A, Vec3};

use crate::gi::surfaces::{Sides, SurfacePoint, SurfacePoints, area_matrix};
use crate::gi::texels::Texel;

/// Most flux of a texel, lumens, with which sums over all texels stay finite. `vpl/sample.wgsl`
/// bounds VPLs by the same.
const MOST_FLUX: f64 = 1e25;

/// A surface whose points have the colours in which it glows: linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GlowingSurface(pub SurfacePoints<Vec3>);

impl GlowingSurface {
    /// How many points there are to draw from.
    pub fn len(&self) -> usize {
        self.0.points.len()
    }

    /// Lumens, weighed by luminance, that one side gives off at radiance `emission` (nits, linear
    /// RGB, times the texture's colour), in its place.
    pub fn power(&self, affine: &Affine3A, emission: DVec3) -> f64 {
        let spread = area_matrix(affine);
        self.0.points.iter().map(|point| self.weight(point, &spread, emission)).sum::<f64>()
            * std::f64::consts::PI
    }

    /// Area × luminance of what a point stands for.
    fn weight(&self, point: &SurfacePoint<Vec3>, spread: &Mat3A, emission: DVec3) -> f64 {
        self.0.area
            * f64::from((*spread * point.normal).length())
            * luminance(emission * point.paint.as_dvec3())
    }

    /// Adds `count` texels for each side that glows: together they give off all that the surface
    /// does, in each channel as far as its colours are even and in luminance exactly.
    pub fn add_texels(
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
            // Between steps, so that no target falls on the border of two points of the same
            // weight, where rounding would choose.
            let target = (number as f64 + 0.381_966) * step;
            while passed <= target && index + 1 < weights.len() {
                index += 1;
                passed += weights[index];
            }
            let point = &self.0.points[index];
            let radiance = emission * point.paint.as_dvec3();
            // Of what it stands for: `step` is area × luminance.
            let area = step / luminance(radiance);
            let flux = (radiance * (area * std::f64::consts::PI)).min(DVec3::splat(MOST_FLUX));
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

//! A glowing surface as points that each stand for a piece of it: plain Rust, no renderer.
//!
//! Points are laid out once in the mesh's own space, evenly by area and in Morton order (neighbours in space are neighbours in the list), and those
//! that become texels are drawn from them at equal steps of power. So the same surface keeps its points while it or anything else moves, points
//! lie where a texture is bright, and drawing from consecutive texels, as virtual point lights are, spreads over the surface.

use bevy::math::{Affine3A, DVec3, Mat3A, Vec3};

use crate::gi::rsm::Texel;

/// Triangles beyond this, metres, are left out: their areas would leave the range of a float.
const GREATEST_COORDINATE: f32 = 1e15;
/// Most flux of a texel, lumens, with which sums over all texels stay finite. `vpl/sample.wgsl` bounds VPLs by the same.
const MOST_FLUX: f64 = 1e25;

/// Which sides of a surface are seen, and so glow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sides {
    /// The side from which triangles run counter-clockwise.
    Front,
    /// The other one.
    Back,
    /// Either.
    Both,
}

impl Sides {
    fn signs(self) -> &'static [f32] {
        match self {
            Self::Front => &[1.0],
            Self::Back => &[-1.0],
            Self::Both => &[1.0, -1.0],
        }
    }

    /// How many.
    pub fn count(self) -> usize {
        self.signs().len()
    }
}

/// A place on a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The triangle's index.
    pub triangle: usize,
    /// Weights of its second and third corner.
    pub weights: [f32; 2],
}

/// A point of a surface, in the mesh's own space.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SurfacePoint {
    position: Vec3,
    /// Unit length.
    normal: Vec3,
    /// What the texture says there, linear RGB; white without one.
    color: Vec3,
}

/// Points that lie evenly on a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct GlowingSurface {
    points: Vec<SurfacePoint>,
    /// That each stands for, in the mesh's own space, m².
    area: f64,
}

impl GlowingSurface {
    /// `count` points on `triangles`; `None` where these have no area. `color` is asked for the texture's colour at each.
    pub fn new(triangles: &[[Vec3; 3]], count: usize, color: impl Fn(Place) -> Vec3) -> Option<Self> {
        let mut total = 0.0;
        let cumulative: Vec<f64> = triangles
            .iter()
            .map(|triangle| {
                let own = area_vector(triangle).length();
                total += if is_usable(triangle) && own.is_finite() { own } else { 0.0 };
                total
            })
            .collect();
        if total <= 0.0 || count == 0 {
            return None;
        }
        let mut points: Vec<SurfacePoint> = (0..count)
            .filter_map(|index| {
                let target = (index as f64 + 0.5) / count as f64 * total;
                let triangle = cumulative.partition_point(|sum| *sum <= target).min(triangles.len() - 1);
                let before = triangle.checked_sub(1).map_or(0.0, |before| cumulative[before]);
                // How far into its triangle is one coordinate, and multiples of the golden ratio are the other: evenly spread, however many
                // points a triangle has.
                let along = ((target - before) / (cumulative[triangle] - before)).clamp(0.0, 1.0);
                let across = (index as f64 * 0.618_033_988_749_895).fract();
                // Uniform over the triangle: Turk 1990, "Generating Random Points in Triangles".
                let root = along.sqrt();
                let weights = [(root * (1.0 - across)) as f32, (root * across) as f32];
                let [a, b, c] = triangles[triangle];
                let normal = area_vector(&triangles[triangle]).try_normalize()?.as_vec3();
                let position = a + (b - a) * weights[0] + (c - a) * weights[1];
                Some(SurfacePoint { position, normal, color: color(Place { triangle, weights }) })
            })
            .collect();
        sort_by_place(&mut points);
        Some(Self { points, area: total / count as f64 })
    }

    /// How many points there are to draw from.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Lumens, weighed by luminance, that one side gives off at radiance `emission` (nits, linear RGB, times the texture's colour), in its place.
    pub fn power(&self, affine: &Affine3A, emission: DVec3) -> f64 {
        let spread = area_matrix(affine);
        self.points.iter().map(|point| self.weight(point, &spread, emission)).sum::<f64>() * std::f64::consts::PI
    }

    /// Area × luminance of what a point stands for.
    fn weight(&self, point: &SurfacePoint, spread: &Mat3A, emission: DVec3) -> f64 {
        self.area * f64::from((*spread * point.normal).length()) * luminance(emission * point.color.as_dvec3())
    }

    /// Adds `count` texels for each side that glows: together they give off all that the surface does, in each channel as far as its colours are
    /// even and in luminance exactly.
    pub fn add_texels(&self, affine: &Affine3A, emission: DVec3, sides: Sides, count: usize, texels: &mut Vec<Texel>) {
        let spread = area_matrix(affine);
        let weights: Vec<f64> = self.points.iter().map(|point| self.weight(point, &spread, emission)).collect();
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return;
        }
        let step = total / count as f64;
        let (mut index, mut passed) = (0, weights[0]);
        for number in 0..count {
            // Between steps, so that no target falls on the border of two points of the same weight, where rounding would choose.
            let target = (number as f64 + 0.381_966) * step;
            while passed <= target && index + 1 < weights.len() {
                index += 1;
                passed += weights[index];
            }
            let point = &self.points[index];
            let radiance = emission * point.color.as_dvec3();
            // Of what it stands for: `step` is area × luminance.
            let area = step / luminance(radiance);
            let flux = (radiance * (area * std::f64::consts::PI)).min(DVec3::splat(MOST_FLUX));
            let (position, normal) = (affine.transform_point3(point.position), (spread * point.normal).normalize_or_zero());
            if !(area.is_finite() && flux.is_finite() && position.is_finite() && normal != Vec3::ZERO) {
                continue;
            }
            let texel = |sign: &f32| Texel::new(position, area as f32, flux.as_vec3(), normal * *sign);
            texels.extend(sides.signs().iter().map(texel));
        }
    }
}

fn luminance(color: DVec3) -> f64 {
    // Rec. 709.
    color.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Normal × area, m².
fn area_vector([a, b, c]: &[Vec3; 3]) -> DVec3 {
    0.5 * (*b - *a).as_dvec3().cross((*c - *a).as_dvec3())
}

fn is_usable(triangle: &[Vec3; 3]) -> bool {
    triangle.iter().all(|corner| corner.is_finite() && corner.abs().max_element() < GREATEST_COORDINATE)
}

/// What turns a normal × area of the mesh into that of the world: a mirrored mesh keeps the side from which its triangles run counter-clockwise.
fn area_matrix(affine: &Affine3A) -> Mat3A {
    let Mat3A { x_axis, y_axis, z_axis } = affine.matrix3;
    Mat3A::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis))
}

/// Orders points along a Morton curve through the box around them.
fn sort_by_place(points: &mut [SurfacePoint]) {
    let least = points.iter().fold(Vec3::INFINITY, |least, point| least.min(point.position));
    let most = points.iter().fold(Vec3::NEG_INFINITY, |most, point| most.max(point.position));
    let size = (most - least).max_element().max(f32::MIN_POSITIVE);
    let spread = |value: f32| {
        let bits = (value / size * 1023.0) as u32;
        (0..10).map(|bit| (bits >> bit & 1) << (3 * bit)).sum::<u32>()
    };
    points.sort_by_cached_key(|point| {
        let Vec3 { x, y, z } = point.position - least;
        spread(x) | spread(y) << 1 | spread(z) << 2
    });
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;

//! Distances along a ray through fog, and their densities.

use glam::DVec3;

/// Least distance of a light from a ray, metres, as if the light were a small ball: on the ray
/// itself the density would be infinite.
const LEAST_DISTANCE: f64 = 1e-6;

/// The part of a ray that is in fog.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Start of the ray, metres.
    pub(crate) origin: DVec3,
    /// Unit length.
    pub(crate) direction: DVec3,
    /// Distances from the start at which the fog begins and ends, metres.
    pub(crate) near: f64,
    /// See `near`.
    pub(crate) far: f64,
    /// 1/m.
    pub(crate) extinction: DVec3,
    /// Whether the fog scatters at all; otherwise no distance is sampled.
    pub(crate) scatters: bool,
}

impl Line {
    /// The point at a distance from the start of the ray.
    pub(crate) fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.direction * distance
    }

    /// Share of light, linear RGB, that gets from the point at `distance`, at least `near`, to the
    /// start of the ray.
    pub(crate) fn transmittance(&self, distance: f64) -> DVec3 {
        (self.extinction * (self.near - distance)).exp()
    }

    /// Samples a distance by transmittance, of a random channel; `None` for a ray that gets
    /// through, which happens by [`survival`](Self::survival).
    pub(crate) fn sample(&self, [channel, number]: [f64; 2]) -> Option<f64> {
        let extinction = self.extinction[((channel * 3.0) as usize).min(2)];
        if !self.scatters || extinction <= 0.0 {
            return None;
        }
        let distance = self.near - (1.0 - number).ln() / extinction;
        (distance < self.far).then_some(distance)
    }

    /// Density of [`sample`](Self::sample), per metre.
    pub(crate) fn density(&self, distance: f64) -> f64 {
        if !self.scatters {
            return 0.0;
        }
        (self.extinction * self.transmittance(distance)).element_sum() / 3.0
    }

    /// Chance that [`sample`](Self::sample) returns none.
    pub(crate) fn survival(&self) -> f64 {
        if self.scatters { self.transmittance(self.far).element_sum() / 3.0 } else { 1.0 }
    }
}

/// Distances along a line, equally dense in the angle under which a point sees them: Kulla and
/// Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media". For
/// parallel light all distances are equally dense, which is the limit of a point far away.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Equiangular {
    /// Of parallel light.
    Uniform { near: f64, far: f64 },
    /// Of a point.
    Point {
        /// Distance from the start of the ray to the foot of the point, metres.
        foot: f64,
        /// Distance of the point from the ray.
        apart: f64,
        /// Angles of both ends of the line from the foot, radians.
        angles: [f64; 2],
    },
}

impl Equiangular {
    /// Distances along `line` that a light at a point lights, or parallel light.
    pub(crate) fn new(line: &Line, point: Option<DVec3>) -> Self {
        let uniform = Self::Uniform { near: line.near, far: line.far };
        let Some(point) = point else { return uniform };
        let ray = point - line.origin;
        let foot = ray.dot(line.direction);
        let apart = (ray - line.direction * foot).length().max(LEAST_DISTANCE);
        let angles = [line.near, line.far].map(|end| ((end - foot) / apart).atan());
        // Far away the two angles round to the same.
        if angles[1] - angles[0] > 1e-9 { Self::Point { foot, apart, angles } } else { uniform }
    }

    /// Samples a distance from the start of the ray, metres.
    pub(crate) fn sample(&self, number: f64) -> f64 {
        match *self {
            Self::Uniform { near, far } => near + (far - near) * number,
            Self::Point { foot, apart, angles: [first, last] } => {
                foot + apart * (first + (last - first) * number).tan()
            }
        }
    }

    /// Density of [`sample`](Self::sample) at a distance on the line, per metre.
    pub(crate) fn density(&self, distance: f64) -> f64 {
        match *self {
            Self::Uniform { near, far } => 1.0 / (far - near),
            Self::Point { foot, apart, angles: [first, last] } => {
                let along = distance - foot;
                apart / ((last - first) * (apart * apart + along * along))
            }
        }
    }
}

//! Distances along a ray through fog, and their densities.

use glam::DVec3;

/// Least distance of a light from a ray, metres, as if the light were a small ball: on the ray
/// itself the density would be infinite.
const LEAST_DISTANCE: f64 = 1e-6;

/// Chances that red, green and blue choose a path's distances.
pub(crate) const CHANNELS: DVec3 = DVec3::splat(1.0 / 3.0);

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
    /// Chances that red, green and blue choose the path's distances, by those that it has: at first
    /// [`CHANNELS`].
    pub(crate) channels: DVec3,
}

/// What becomes of light on a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Distance from the start of the ray at which it is scattered; `None` where it gets through.
    pub(crate) distance: Option<f64>,
    /// Transmittance ÷ density of the distance, metres, or ÷ the chance to get through.
    pub(crate) weight: DVec3,
    /// `channels` of the path's next line.
    pub(crate) channels: DVec3,
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

    /// Samples a distance by transmittance, of a random channel.
    ///
    /// One channel chooses all distances of a path: Wilkie et al. 2014, "Hero Wavelength Spectral
    /// Sampling", with the balance heuristic over channels. Were each distance weighed alone, the
    /// weights of long paths would grow without bound.
    pub(crate) fn sample(&self, [channel, number]: [f64; 2]) -> Step {
        let [red, green, _] = self.channels.to_array();
        let channel = usize::from(channel >= red) + usize::from(channel >= red + green);
        let distance = self.near - (1.0 - number).ln() / self.extinction[channel];
        let distance = (self.scatters && distance < self.far).then_some(distance);
        let transmittance = self.transmittance(distance.unwrap_or(self.far));
        let densities = match distance {
            _ if !self.scatters => DVec3::ONE,
            Some(_) => self.extinction * transmittance,
            None => transmittance,
        };
        let density = self.channels.dot(densities);
        let channels = self.channels * densities / density;
        Step { distance, weight: transmittance / density, channels }
    }

    /// Density of [`sample`](Self::sample), per metre.
    pub(crate) fn density(&self, distance: f64) -> f64 {
        let densities = self.extinction * self.transmittance(distance);
        if self.scatters { self.channels.dot(densities) } else { 0.0 }
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

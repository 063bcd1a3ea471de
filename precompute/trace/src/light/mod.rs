//! Light sources: `emitters` are emissive triangles, `sky` is the environment. Here are punctual
//! lights (directional, point and spot) as in the renderer's light maps: the formulas are those of
//! `gi/rsm/resolve.wgsl` and `gi/rsm/lights.rs` in the plugin, which are Bevy's.

mod emitters;
mod sky;

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::color::color;
use crate::scene::triple;
pub(crate) use emitters::{EmitterPoint, Emitters};
pub(crate) use sky::Sampled;
pub use sky::{MappedSky, Sky};

/// Least squared distance to a light, m²: the attenuation is constant below it. Keeps the
/// illuminance of a light inside a wall finite.
const LEAST_DISTANCE_SQUARED: f64 = 1e-12;

/// A light. Colours are linear RGB that scale the light, each at least 0; quantities are
/// photometric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Light {
    /// Parallel light, such as the sun's.
    Directional {
        /// Direction in which the light travels, not zero; need not be a unit vector.
        #[serde(with = "triple")]
        direction: Vec3,
        /// Illuminance of a surface that faces the light, lux, at least 0.
        illuminance: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
    /// A point light.
    Point {
        /// Metres.
        #[serde(with = "triple")]
        position: Vec3,
        /// Luminous power, lumens, at least 0.
        luminous_power: f32,
        /// Range, metres, greater than 0: there is no light beyond it; 30 by default.
        #[serde(default = "default_range")]
        range: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
    /// A spot light.
    Spot {
        /// Metres.
        #[serde(with = "triple")]
        position: Vec3,
        /// The axis of the cone, not zero; need not be a unit vector.
        #[serde(with = "triple")]
        direction: Vec3,
        /// Luminous power, lumens, at least 0. As in Bevy, that of a point light without the cone:
        /// the cone masks the light and does not concentrate it, so that the intensity on the axis
        /// is power ÷ 4π candela.
        luminous_power: f32,
        /// Range, metres, greater than 0: there is no light beyond it; 30 by default.
        #[serde(default = "default_range")]
        range: f32,
        /// Half angle of the cone that is fully lit, degrees, in [0, `outer_angle`]; 30 by default.
        #[serde(default = "default_inner_angle")]
        inner_angle: f32,
        /// Half angle at which the light ends, degrees, in (0, 90]; 45 by default.
        #[serde(default = "default_outer_angle")]
        outer_angle: f32,
        /// Colour; white by default.
        #[serde(default = "white")]
        color: [f32; 3],
    },
}

/// A light without extent: a scattered path never hits it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PunctualLight {
    /// Parallel rays.
    Directional {
        /// Direction to the light, unit length.
        towards: DVec3,
        /// Linear RGB, lux on a surface that faces it.
        illuminance: DVec3,
    },
    /// A point or spot light.
    Positional {
        /// Metres.
        position: DVec3,
        /// Linear RGB, candela.
        intensity: DVec3,
        /// 1/m².
        inverse_range_squared: f64,
        /// Axis of the cone, unit length.
        axis: DVec3,
        /// Attenuation is saturate(cos · scale + offset)²; 0 and 1 without a cone.
        cone: (f64, f64),
    },
}

/// Incident light of one source at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IncidentLight {
    /// Direction to the light, unit length.
    pub(crate) direction: DVec3,
    /// Metres to the light.
    pub(crate) distance: f64,
    /// Linear RGB, lux on a surface that faces it.
    pub(crate) illuminance: DVec3,
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn default_range() -> f32 {
    30.0
}

fn default_inner_angle() -> f32 {
    30.0
}

fn default_outer_angle() -> f32 {
    45.0
}

impl PunctualLight {
    /// Converts a scene's light; `None` where its intensity is 0, negative or not finite.
    pub(crate) fn new(light: &Light) -> Option<Self> {
        let (axis, cone) = match light {
            Light::Spot { direction, inner_angle, outer_angle, .. } => {
                let outer = f64::from(*outer_angle).to_radians().min(FRAC_PI_2 - 1e-4);
                let inner = f64::from(*inner_angle).to_radians().min(outer);
                let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-4);
                let axis = direction.as_dvec3().normalize_or(DVec3::NEG_Y);
                (axis, (scale, -outer.cos() * scale))
            }
            Light::Directional { .. } | Light::Point { .. } => (DVec3::NEG_Y, (0.0, 1.0)),
        };
        let light = match light {
            Light::Directional { direction, illuminance, color: rgb } => Self::Directional {
                towards: -direction.as_dvec3().normalize_or(DVec3::NEG_Y),
                illuminance: color(*rgb) * f64::from(*illuminance),
            },
            Light::Point { position, luminous_power, range, color: rgb }
            | Light::Spot { position, luminous_power, range, color: rgb, .. } => Self::Positional {
                position: position.as_dvec3(),
                // Bevy divides by the full sphere, whatever the cone.
                intensity: color(*rgb) * (f64::from(*luminous_power) / (4.0 * PI)),
                inverse_range_squared: f64::from(*range).powi(2).recip(),
                axis,
                cone,
            },
        };
        let (Self::Directional { illuminance: strength, .. }
        | Self::Positional { intensity: strength, .. }) = light;
        (strength.is_finite() && strength.min_element() >= 0.0 && strength.max_element() > 0.0)
            .then_some(light)
    }

    /// Unoccluded light at `position`; `None` beyond the light's range and outside its cone.
    pub(crate) fn incident(&self, position: DVec3) -> Option<IncidentLight> {
        match *self {
            Self::Directional { towards, illuminance } => {
                Some(IncidentLight { direction: towards, distance: f64::INFINITY, illuminance })
            }
            Self::Positional {
                position: light,
                intensity,
                inverse_range_squared,
                axis,
                cone: (scale, offset),
            } => {
                let ray = light - position;
                let distance_squared = ray.length_squared().max(LEAST_DISTANCE_SQUARED);
                let distance = distance_squared.sqrt();
                let cone = (-ray.dot(axis) / distance * scale + offset).clamp(0.0, 1.0);
                let window =
                    (1.0 - (distance_squared * inverse_range_squared).powi(2)).clamp(0.0, 1.0);
                let illuminance = intensity * (cone * cone * window * window / distance_squared);
                (illuminance.max_element() > 0.0).then(|| IncidentLight {
                    direction: ray / distance,
                    distance,
                    illuminance,
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_positional_light_fades_by_distance_range_and_cone() {
        let power = 400.0 * std::f32::consts::PI;
        let point = Light::Point {
            position: Vec3::ZERO,
            luminous_power: power,
            range: 10.0,
            color: [1.0, 0.5, 0.0],
        };
        let light = PunctualLight::new(&point).unwrap();
        let near = light.incident(DVec3::X * 0.1).unwrap();
        assert!(
            (near.illuminance - DVec3::new(1e4, 5e3, 0.0)).abs().max_element() < 0.1,
            "{near:?}"
        );
        assert!(
            (near.direction - DVec3::NEG_X).length() < 1e-12 && (near.distance - 0.1).abs() < 1e-12
        );
        // (1 − (5/10)⁴)² of 100/25 lux.
        let half_way = light.incident(DVec3::Y * 5.0).unwrap().illuminance.x;
        assert!((half_way - 4.0 * (15.0_f64 / 16.0).powi(2)).abs() < 1e-4, "{half_way}");
        assert!(
            light.incident(DVec3::Z * 10.0).is_none() && light.incident(DVec3::Z * 1e30).is_none()
        );
        let inside = light.incident(DVec3::ZERO).unwrap();
        assert!(inside.illuminance.is_finite() && inside.direction.is_finite());
        let (inner_angle, outer_angle) = (20.0, 40.0);
        let spot = Light::Spot {
            position: Vec3::ZERO,
            direction: Vec3::NEG_Z,
            luminous_power: power,
            range: 1e6,
            inner_angle,
            outer_angle,
            color: [1.0; 3],
        };
        let spot = PunctualLight::new(&spot).unwrap();
        let at = |degrees: f64| {
            let angle = degrees.to_radians();
            spot.incident(DVec3::new(angle.sin(), 0.0, -angle.cos()))
                .map_or(0.0, |incident| incident.illuminance.x)
        };
        assert!(
            (at(0.0) - 100.0).abs() < 1e-3
                && (at(19.9) - 100.0).abs() < 1e-3
                && at(40.1) == 0.0
                && at(180.0) == 0.0
        );
        assert!((1.0..99.0).contains(&at(30.0)));
    }

    #[test]
    fn dark_and_broken_lights_are_left_out() {
        let sun = |illuminance| {
            PunctualLight::new(&Light::Directional {
                direction: Vec3::NEG_Y,
                illuminance,
                color: [1.0; 3],
            })
            .is_some()
        };
        assert_eq!(
            [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-30, 1e30].map(sun),
            [false, false, false, false, true, true]
        );
    }
}

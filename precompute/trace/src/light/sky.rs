//! The environment as a light.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::color::{color, luminance};
use crate::sampler::pick;
use crate::scene::SkyMap;

/// Radiance of rays that miss all geometry.
#[derive(Debug)]
pub enum Sky {
    /// Black.
    Black,
    /// The same in all directions, nits. Has no light sampling: BSDF sampling is already optimal.
    Constant(DVec3),
    /// A map, importance-sampled by luminance.
    Map(MappedSky),
}

/// A sky map and its sampling distribution.
#[derive(Debug)]
pub struct MappedSky {
    map: SkyMap,
    /// Nits for a map value of 1.
    intensity: f64,
    /// Running sum of luminance × solid angle, row by row. Texels are sampled by it, so their
    /// densities are ∝ luminance.
    cumulative: Vec<f64>,
}

/// A point of an emissive triangle, or a direction of the sky.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampled {
    /// Towards it, unit length.
    pub(crate) direction: DVec3,
    /// Metres; infinite for the sky.
    pub(crate) distance: f64,
    /// Nits.
    pub(crate) radiance: DVec3,
    /// Probability density, per steradian.
    pub(crate) density: f64,
    /// Where it is; none for the sky.
    #[cfg_attr(not(feature = "media"), expect(dead_code, reason = "fog alone asks for places"))]
    pub(crate) point: Option<DVec3>,
}

impl Sky {
    /// The same `radiance` from all directions, linear RGB, nits.
    pub fn constant(radiance: [f32; 3]) -> Self {
        if radiance == [0.0; 3] { Self::Black } else { Self::Constant(color(radiance)) }
    }

    /// A sky map whose value 1 stands for `intensity` nits; [`Black`](Self::Black) where its power
    /// is 0.
    pub fn map(map: SkyMap, intensity: f32) -> Self {
        let (width, height) = map.size();
        let mut power = 0.0;
        let mut cumulative = Vec::with_capacity(map.texels().len());
        for (row, texels) in map.texels().chunks_exact(width as usize).enumerate() {
            let solid_angle = solid_angle(row, width, height);
            for texel in texels {
                power += luminance(color(*texel)) * solid_angle;
                cumulative.push(power);
            }
        }
        let intensity = f64::from(intensity);
        if power * intensity > 0.0 {
            Self::Map(MappedSky { map, intensity, cumulative })
        } else {
            Self::Black
        }
    }

    /// Radiance from `direction`, a unit vector, in nits.
    pub(crate) fn radiance(&self, direction: DVec3) -> DVec3 {
        match self {
            Self::Black => DVec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Map(sky) => color(sky.map.look_up(direction.as_vec3())) * sky.intensity,
        }
    }

    /// Density of [`sample`](Self::sample) at `direction`, per steradian; 0 for skies that are not
    /// sampled.
    pub(crate) fn density(&self, direction: DVec3) -> f64 {
        match self {
            Self::Map(sky) => sky.density(sky.map.index(direction.as_vec3())),
            Self::Black | Self::Constant(_) => 0.0,
        }
    }

    /// Samples a direction; `None` for skies that are not sampled.
    pub(crate) fn sample(&self, choice: f64, [u1, u2]: [f64; 2]) -> Option<Sampled> {
        let Self::Map(sky) = self else { return None };
        let index = pick(&sky.cumulative, choice)?;
        let (width, height) = sky.map.size();
        let (row, column) = (index / width as usize, index % width as usize);
        // Uniform in solid angle inside the texel: in azimuth and in the cosine of the polar angle.
        let (top, bottom) = (edge_cosine(row, height), edge_cosine(row + 1, height));
        let y = top + (bottom - top) * u2;
        let sine = (1.0 - y * y).max(0.0).sqrt();
        let angle = ((column as f64 + u1) / f64::from(width) - 0.5) * TAU;
        Some(Sampled {
            direction: DVec3::new(sine * angle.sin(), y, -sine * angle.cos()),
            distance: f64::INFINITY,
            radiance: color(sky.map.texels()[index]) * sky.intensity,
            density: sky.density(index),
            point: None,
        })
    }

    /// Integral of the luminance of a map over all directions, lux; 0 for other skies.
    pub(crate) fn power(&self) -> f64 {
        let Self::Map(sky) = self else { return 0.0 };
        sky.cumulative.last().map_or(0.0, |power| power * sky.intensity)
    }

    /// Whether the sky emits light.
    pub(crate) fn is_lit(&self) -> bool {
        !matches!(self, Self::Black)
    }
}

impl MappedSky {
    fn density(&self, index: usize) -> f64 {
        self.cumulative
            .last()
            .map_or(0.0, |power| luminance(color(self.map.texels()[index])) / power)
    }
}

/// Cosine of the polar angle of a row's upper edge.
fn edge_cosine(row: usize, height: u32) -> f64 {
    (PI * row as f64 / f64::from(height)).cos()
}

/// Solid angle of a texel, steradians.
fn solid_angle(row: usize, width: u32, height: u32) -> f64 {
    TAU / f64::from(width) * (edge_cosine(row, height) - edge_cosine(row + 1, height))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::Sampler;
    use crate::testing::fit_directions;

    fn uneven() -> Sky {
        let texels = (0..16 * 8)
            .map(|i| if i % 5 == 0 { [0.0; 3] } else { [i as f32, 1.0, (i % 7) as f32 * 40.0] })
            .collect();
        Sky::map(SkyMap::new(16, 8, texels).unwrap(), 3.0)
    }

    #[test]
    fn samples_agree_with_their_density_and_with_look_ups() {
        let sky = uneven();
        let mut power = DVec3::ZERO;
        let count = 1 << 14;
        for i in 0..count {
            let mut sampler = Sampler::new(5, 0, i);
            let sample = sky.sample(sampler.number(), sampler.pair()).unwrap();
            assert!((sample.direction.length() - 1.0).abs() < 1e-12);
            // A sample on the very edge of a texel may round to its neighbour.
            if i % 16 == 0 && (sky.density(sample.direction) - sample.density).abs() < 1e-9 {
                assert_eq!(sky.radiance(sample.direction), sample.radiance);
            }
            power += sample.radiance / sample.density / f64::from(count);
        }
        // ∫ L dω is known: texels are constant.
        let Sky::Map(map) = &sky else { panic!("a lit sky") };
        let exact: DVec3 = map
            .map
            .texels()
            .iter()
            .enumerate()
            .map(|(i, texel)| color(*texel) * (3.0 * solid_angle(i / 16, 16, 8)))
            .sum();
        assert!(((power - exact) / exact).abs().max_element() < 0.01, "{power} {exact}");
        // Sampling is proportional to luminance: its estimate has no noise.
        assert!((luminance(power) / luminance(exact) - 1.0).abs() < 1e-9);
        let edges = (0..count).filter(|i| {
            let mut sampler = Sampler::new(5, 0, *i);
            let sample = sky.sample(sampler.number(), sampler.pair()).unwrap();
            (sky.density(sample.direction) - sample.density).abs() > 1e-9
        });
        assert!(edges.count() < count as usize / 1000);
    }

    #[test]
    fn sampled_directions_have_their_density() {
        let sample = |sky: &Sky, sampler: &mut Sampler| {
            sky.sample(sampler.number(), sampler.pair()).map(|sample| sample.direction)
        };
        let sun = |i| if i == 37 { [900.0, 800.0, 700.0] } else { [1.0, 2.0, 3.0] };
        let sunny = Sky::map(SkyMap::new(16, 8, (0..128).map(sun).collect()).unwrap(), 3.0);
        for (name, sky) in [("uneven sky", &uneven()), ("sunny sky", &sunny)] {
            for axis in [DVec3::Y, DVec3::new(0.48, 0.6, -0.64)] {
                let fit = fit_directions((axis, 1), |it| sample(sky, it), |to| sky.density(to));
                fit.assert(name);
            }
        }
    }

    #[test]
    fn densities_cover_the_sphere_once() {
        let sky = uneven();
        let (columns, rows) = (64, 512);
        let mut sum = 0.0;
        for row in 0..rows {
            for column in 0..columns {
                let y = 1.0 - 2.0 * (f64::from(row) + 0.5) / f64::from(rows);
                let angle = TAU * (f64::from(column) + 0.5) / f64::from(columns);
                let sine = (1.0 - y * y).sqrt();
                sum += sky.density(DVec3::new(sine * angle.sin(), y, sine * angle.cos()));
            }
        }
        let integral = sum * 4.0 * PI / f64::from(columns * rows);
        assert!((integral - 1.0).abs() < 0.01, "{integral}");
    }

    #[test]
    fn a_black_map_is_no_light() {
        let dark = Sky::map(SkyMap::new(2, 1, vec![[0.0; 3]; 2]).unwrap(), 1.0);
        assert!(!dark.is_lit() && dark.sample(0.5, [0.5; 2]).is_none());
        assert!(!Sky::map(SkyMap::new(1, 1, vec![[1.0; 3]]).unwrap(), 0.0).is_lit());
        let constant = Sky::Constant(DVec3::ONE);
        assert!(
            constant.is_lit()
                && constant.sample(0.5, [0.5; 2]).is_none()
                && constant.density(DVec3::X) == 0.0
        );
    }
}

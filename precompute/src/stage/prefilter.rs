//! Prefilters a sky into Bevy's environment cube maps: irradiance by normal, and specular radiance
//! by roughness.
//!
//! Karis 2013, "Real Shading in Unreal Engine 4": reflections are averaged with the view along the
//! normal, one mip level per roughness. Samples read the sky at the mip level of their solid angle
//! (Colbert and Křivánek 2007, "GPU-Based Importance Sampling"), so that few samples leave no
//! noise.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use frugal_trace::scene::SkyMap;

/// Columns of the finest level: twice its rows.
const COLUMNS: u32 = 256;
/// Texels along the edge of the diffuse cube's faces.
const DIFFUSE_EDGE: u32 = 16;
/// The same for each level of the specular cube: roughness 0, a fifth, …, 1. Rough levels are
/// smooth enough for few texels.
const SPECULAR_EDGES: [u32; 6] = [128, 64, 32, 16, 8, 4];
/// Samples per texel of a rough level.
const SPECULAR_SAMPLES: u32 = 128;

/// Faces of a cube map, each with all its mip levels, in GPU order.
pub(super) struct Cube {
    /// Texels along an edge of the finest level.
    pub(super) edge: u32,
    /// Mip levels.
    pub(super) levels: u32,
    /// Face by face, level by level, row by row.
    pub(super) texels: Vec<[f32; 3]>,
}

impl Cube {
    /// A cube of one texel per face.
    pub(super) fn constant(texel: [f32; 3]) -> Self {
        Self { edge: 1, levels: 1, texels: vec![texel; 6] }
    }

    /// Evaluates `texel` for each level and direction (a unit vector). `edges` halve from level to
    /// level.
    pub(super) fn new(edges: &[u32], texel: impl Fn(usize, Vec3) -> [f32; 3]) -> Self {
        let mut texels = Vec::new();
        for face in 0..6 {
            for (level, edge) in edges.iter().enumerate() {
                let coordinates = (0..*edge).flat_map(|y| (0..*edge).map(move |x| (x, y)));
                texels.extend(
                    coordinates.map(|(x, y)| texel(level, cube_direction(face, x, y, *edge))),
                );
            }
        }
        Self { edge: edges[0], levels: edges.len() as u32, texels }
    }
}

/// Direction through a texel's centre, in the order of faces that GPUs use (+X, −X, +Y, −Y, +Z, −Z;
/// left-handed).
fn cube_direction(face: u32, x: u32, y: u32, edge: u32) -> Vec3 {
    let u = 2.0 * (x as f32 + 0.5) / edge as f32 - 1.0;
    let v = 1.0 - 2.0 * (y as f32 + 0.5) / edge as f32;
    let direction = match face {
        0 => Vec3::new(1.0, v, -u),
        1 => Vec3::new(-1.0, v, u),
        2 => Vec3::new(u, 1.0, -v),
        3 => Vec3::new(u, -1.0, v),
        4 => Vec3::new(u, v, 1.0),
        _ => Vec3::new(-u, v, -1.0),
    };
    // Bevy samples its sky with z negated.
    (direction * Vec3::new(1.0, 1.0, -1.0)).normalize()
}

/// Mip pyramid of a latitude-longitude sky.
pub(super) struct Pyramid {
    /// Each level has half the columns of the one before; the last has two.
    levels: Vec<SkyMap>,
}

impl Pyramid {
    pub(super) fn new(map: &SkyMap) -> Self {
        let (width, height) = map.size();
        // Each texel of the finest level is a mean of at least one look-up per texel of the map
        // that it covers.
        let steps = (width.div_ceil(COLUMNS)).max(height.div_ceil(COLUMNS / 2)).clamp(1, 32);
        let finest = |x: u32, y: u32| {
            mean((0..steps * steps).map(|step| {
                let (u, v) = ((step % steps) as f32 + 0.5, (step / steps) as f32 + 0.5);
                let direction =
                    direction(x as f32 + u / steps as f32, y as f32 + v / steps as f32, COLUMNS);
                (map.look_up(direction), 1.0)
            }))
        };
        let mut levels = vec![sky(COLUMNS, finest)];
        let mut columns = COLUMNS;
        while columns > 2 {
            columns /= 2;
            let finer = &levels[levels.len() - 1];
            // Rows near the poles cover less solid angle.
            let next = sky(columns, |x, y| {
                mean((0..4).map(|i| {
                    let (x, y) = (2 * x + i % 2, 2 * y + i / 2);
                    (
                        finer.texels()[(y * 2 * columns + x) as usize],
                        (PI * (y as f32 + 0.5) / columns as f32).sin(),
                    )
                }))
            });
            levels.push(next);
        }
        Self { levels }
    }

    /// Illuminance ÷ π by the surface's normal.
    pub(super) fn diffuse(&self) -> Cube {
        let map = &self.levels[2];
        let (columns, rows) = map.size();
        let directions: Vec<(Vec3, f32, [f32; 3])> = (0..rows)
            .flat_map(|y| (0..columns).map(move |x| (x, y)))
            .map(|(x, y)| {
                let solid_angle = TAU / columns as f32 * PI / rows as f32
                    * (PI * (y as f32 + 0.5) / rows as f32).sin();
                (
                    direction(x as f32 + 0.5, y as f32 + 0.5, columns),
                    solid_angle,
                    map.texels()[(y * columns + x) as usize],
                )
            })
            .collect();
        Cube::new(&[DIFFUSE_EDGE], |_, normal| {
            // Divided by the sum for a white sky, so that the quadrature error cancels.
            mean(directions.iter().map(|(direction, solid_angle, texel)| {
                (*texel, direction.dot(normal).max(0.0) * solid_angle)
            }))
        })
    }

    /// Specular radiance by direction; one level per roughness.
    pub(super) fn specular(&self) -> Cube {
        Cube::new(&SPECULAR_EDGES, |level, normal| {
            if level == 0 {
                return self.look_up(0.0, normal);
            }
            let roughness = level as f32 / (SPECULAR_EDGES.len() - 1) as f32;
            let alpha = (roughness * roughness).max(1e-3);
            let (right, up) = normal.any_orthonormal_pair();
            mean((0..SPECULAR_SAMPLES).map(|sample| {
                // A Hammersley set.
                let (u, v) = (
                    (sample as f32 + 0.5) / SPECULAR_SAMPLES as f32,
                    sample.reverse_bits() as f32 * 2f32.powi(-32),
                );
                // Walter et al. 2007, "Microfacet Models for Refraction": half vectors by the GGX
                // distribution.
                let cosine = ((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u)).sqrt();
                let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
                let half =
                    normal * cosine + (right * (TAU * v).cos() + up * (TAU * v).sin()) * sine;
                let light = half * (2.0 * cosine) - normal;
                let peak =
                    alpha * alpha / (PI * (1.0 + (alpha * alpha - 1.0) * cosine * cosine).powi(2));
                // With the view along the normal, the density of the direction is that of the half
                // vector ÷ 4.
                let solid_angle = 4.0 / (SPECULAR_SAMPLES as f32 * peak);
                let texel = 4.0 * PI / (COLUMNS * COLUMNS / 2) as f32;
                (
                    self.look_up((0.5 * (solid_angle / texel).log2()).max(0.0) + 1.0, light),
                    light.dot(normal).max(0.0),
                )
            }))
        })
    }

    /// Radiance in a direction at the level nearest to `level`.
    fn look_up(&self, level: f32, direction: Vec3) -> [f32; 3] {
        self.levels[(level.round() as usize).min(self.levels.len() - 1)]
            .look_up(direction.normalize_or(Vec3::Y))
    }
}

/// Direction at a position, in texels, of a latitude-longitude map with `columns` columns.
fn direction(x: f32, y: f32, columns: u32) -> Vec3 {
    let angle = (x / columns as f32 - 0.5) * TAU;
    let (sine, cosine) = (2.0 * PI * y / columns as f32).sin_cos();
    Vec3::new(sine * angle.sin(), cosine, -sine * angle.cos())
}

fn mean(values: impl Iterator<Item = ([f32; 3], f32)>) -> [f32; 3] {
    let (sum, weights) = values.fold((Vec3::ZERO, 0.0), |(sum, weights), (value, weight)| {
        (sum + Vec3::from(value) * weight, weights + weight)
    });
    (sum / f32::max(weights, f32::MIN_POSITIVE)).to_array()
}

fn sky(columns: u32, texel: impl Fn(u32, u32) -> [f32; 3]) -> SkyMap {
    let rows = columns / 2;
    let texels: Vec<[f32; 3]> = (0..rows)
        .flat_map(|y| (0..columns).map(move |x| (x, y)))
        .map(|(x, y)| texel(x, y))
        .collect();
    SkyMap::of_means(columns, rows, texels)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean over directions: rows near the poles cover less solid angle.
    fn mean_radiance(sky: &SkyMap) -> f64 {
        let (width, height) = sky.size();
        let rows = sky.texels().chunks_exact(width as usize).enumerate();
        let texels = rows.flat_map(|(y, row)| {
            let weight = (std::f64::consts::PI * (y as f64 + 0.5) / f64::from(height)).sin();
            row.iter().map(move |texel| (weight, weight * f64::from(texel[0])))
        });
        let (weights, sum) = texels.fold((0.0, 0.0), |(a, b), (c, d)| (a + c, b + d));
        sum / weights
    }

    /// Texels of one level of a cube with their directions.
    fn texels(cube: &Cube, edges: &[u32], level: usize) -> Vec<(Vec3, f32)> {
        let face_texels: u32 = edges.iter().map(|edge| edge * edge).sum();
        let before: u32 = edges[..level].iter().map(|edge| edge * edge).sum();
        let edge = edges[level];
        let texel = |face: u32, x: u32, y: u32| {
            cube.texels[(face * face_texels + before + y * edge + x) as usize][1]
        };
        let coordinates =
            (0..6).flat_map(|face| (0..edge * edge).map(move |i| (face, i % edge, i / edge)));
        coordinates
            .map(|(face, x, y)| (cube_direction(face, x, y, edge), texel(face, x, y)))
            .collect()
    }

    #[test]
    fn a_uniform_sky_stays_uniform() {
        let pyramid = Pyramid::new(&SkyMap::new(10, 5, vec![[1.0, 2.0, 3.0]; 50]).unwrap());
        for cube in [pyramid.diffuse(), pyramid.specular()] {
            let even = |texel: &[f32; 3]| {
                texel.iter().zip([1.0, 2.0, 3.0]).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-3)
            };
            assert!(cube.texels.iter().all(even));
        }
    }

    #[test]
    fn half_a_sky_lights_by_the_cosine() {
        // Bright above: illuminance ÷ π is (1 + n·y) / 2.
        let texels_above =
            (0..64 * 32).map(|i| if i / 64 < 16 { [1.0; 3] } else { [0.0; 3] }).collect();
        let pyramid = Pyramid::new(&SkyMap::new(64, 32, texels_above).unwrap());
        for (normal, found) in texels(&pyramid.diffuse(), &[DIFFUSE_EDGE], 0) {
            assert!((found - 0.5 * (1.0 + normal.y)).abs() < 0.02, "{normal} {found}");
        }
        // Roughness blurs only the horizon.
        let specular = pyramid.specular();
        for level in 0..SPECULAR_EDGES.len() - 1 {
            for (direction, found) in texels(&specular, &SPECULAR_EDGES, level) {
                let blur = 0.05 + level as f32 * 0.2;
                let expected = if direction.y > 0.0 { 1.0 } else { 0.0 };
                assert!(
                    direction.y.abs() < blur || (found - expected).abs() < 0.1,
                    "level {level}: {direction} {found}"
                );
            }
        }
    }

    #[test]
    fn a_small_sun_keeps_its_light() {
        let mut texels_sun = vec![[0.0; 3]; 512 * 256];
        texels_sun[64 * 512 + 100] = [1e4; 3];
        let map = SkyMap::new(512, 256, texels_sun).unwrap();
        let pyramid = Pyramid::new(&map);
        let expected = mean_radiance(&map);
        for level in &pyramid.levels {
            assert!(
                (mean_radiance(level) / expected - 1.0).abs() < 0.05,
                "{} columns",
                level.size().0
            );
        }
        let toward = direction(100.5, 64.5, 512);
        let (brightest, _) = texels(&pyramid.diffuse(), &[DIFFUSE_EDGE], 0)
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(brightest.dot(toward) > 0.99, "{brightest} {toward}");
    }
}

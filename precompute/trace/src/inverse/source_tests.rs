//! A test of geometry terms and of the tracer: a small source is found from the light that it leaves on
//! a plane.
//!
//! A virtual point light leaves on the plane z = 0 the irradiance (m · (p − x)) h ÷ |p − x|⁴ at p,
//! with x its place, h its height and m its normal × flux ÷ π: linear in m. Liu, Hua and others solve
//! such systems of six unknowns with Gröbner bases; here the three of m are eliminated by least
//! squares, and the three of x found by iteration (Golub and Pereyra 1973, "The Differentiation of
//! Pseudo-Inverses and Nonlinear Least Squares Problems Whose Variables Separate").

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3, Quat, UVec2, Vec3};

use super::tests::scene;
use crate::bsdf::Shading;
use crate::integrator::{Settings, View, Watch, render};
use crate::sampler::Sampler;
use crate::scene::testing::MeshBuilder;
use crate::scene::{CameraPose, SceneMaterial};

/// Heights from which the search starts, as shares of the plane's lit extent.
const STARTS: [f64; 3] = [0.15, 0.5, 1.5];
const ITERATIONS: usize = 60;
/// Points that are darker than this share of the brightest may be behind the source.
const DARK: f64 = 1e-4;

/// The irradiance of a point of the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Irradiance {
    /// x and y, metres.
    point: DVec2,
    /// Lux, at least 0.
    lux: f64,
}

/// A small Lambertian source, as a virtual point light is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    /// Metres; z is above 0.
    position: DVec3,
    /// Unit length.
    normal: DVec3,
    /// Lumens.
    flux: f64,
}

impl Source {
    /// The irradiance that it leaves at a point of the plane z = 0, lux.
    fn lux(&self, point: DVec2) -> f64 {
        let ray = point.extend(0.0) - self.position;
        let squared = ray.length_squared();
        let cosines = self.normal.dot(ray).max(0.0) * self.position.z.max(0.0);
        if cosines > 0.0 { self.flux / PI * cosines / (squared * squared) } else { 0.0 }
    }

    /// The source of the least squared relative error. Of a source and its mirror image below the
    /// plane, which leaves the same light on a plane that shines through, the one above is it.
    ///
    /// Dark points are left out: they may be behind the source. Values that are not finite are, too.
    /// `None` for less than 7 lit points, and where the search finds none.
    fn find(light: &[Irradiance]) -> Option<Self> {
        let is_sound = |one: &&Irradiance| one.lux.is_finite() && one.point.is_finite();
        let most = light.iter().filter(is_sound).map(|one| one.lux).fold(0.0, f64::max);
        let lit: Vec<Irradiance> =
            light.iter().filter(is_sound).filter(|one| one.lux > DARK * most).copied().collect();
        if lit.len() < 7 {
            return None;
        }
        let total: f64 = lit.iter().map(|one| one.lux).sum();
        let middle = lit.iter().map(|one| one.point * one.lux).sum::<DVec2>() / total;
        let spread =
            lit.iter().map(|one| one.point.distance_squared(middle) * one.lux).sum::<f64>();
        let extent = (spread / total).sqrt();
        let fits = STARTS.map(|start| descend(&lit, middle.extend(start * extent)));
        let best = fits.into_iter().flatten().min_by(|a, b| a.error.total_cmp(&b.error))?;
        let length = best.moment.length();
        let is_sound = length > 0.0 && length.is_finite() && best.position.is_finite();
        is_sound.then(|| Self {
            position: best.position,
            normal: best.moment / length,
            flux: length * PI,
        })
    }
}

#[derive(Clone, Debug)]
struct Fit {
    position: DVec3,
    moment: DVec3,
    residuals: Vec<f64>,
    /// Sum of squared residuals.
    error: f64,
}

/// The best moment for a place, relative to the light so that faint points count as much.
fn fit(lit: &[Irradiance], position: DVec3) -> Option<Fit> {
    let factor = |one: &Irradiance| {
        let ray = one.point.extend(0.0) - position;
        let squared = ray.length_squared();
        ray * (position.z / (squared * squared * one.lux))
    };
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for one in lit {
        let own = factor(one);
        matrix += DMat3::from_cols(own * own.x, own * own.y, own * own.z);
        right += own;
    }
    let scale = matrix.to_cols_array().iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let moment = (matrix * (1.0 / scale)).inverse() * (right / scale);
    let residuals: Vec<f64> = lit.iter().map(|one| factor(one).dot(moment) - 1.0).collect();
    let error = residuals.iter().map(|residual| residual * residual).sum::<f64>();
    (error.is_finite() && moment.is_finite()).then_some(Fit { position, moment, residuals, error })
}

/// Levenberg 1944 and Marquardt 1963, with differences for derivatives. The height is searched as
/// its logarithm, which keeps the source above the plane.
fn descend(lit: &[Irradiance], start: DVec3) -> Option<Fit> {
    let placed = |place: DVec3| DVec3::new(place.x, place.y, place.z.exp());
    let mut place = DVec3::new(start.x, start.y, start.z.max(1e-9).ln());
    let mut best = fit(lit, placed(place))?;
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        let step = 1e-6 * best.position.z;
        let steps = [DVec3::X * step, DVec3::Y * step, DVec3::Z * 1e-6];
        let mut slopes = Vec::with_capacity(3);
        for step in steps {
            let other = fit(lit, placed(place + step))?;
            let length = step.length();
            let pairs = other.residuals.iter().zip(&best.residuals);
            slopes.push(pairs.map(|(after, before)| (after - before) / length).collect::<Vec<_>>());
        }
        let (mut matrix, mut right) = ([[0.0; 3]; 3], DVec3::ZERO);
        for a in 0..3 {
            for (b, entry) in matrix[a].iter_mut().enumerate() {
                *entry = slopes[a].iter().zip(&slopes[b]).map(|(a, b)| a * b).sum();
            }
            right[a] = -slopes[a].iter().zip(&best.residuals).map(|(a, b)| a * b).sum::<f64>();
        }
        let matrix = DMat3::from_cols_array_2d(&matrix);
        let mut is_better = false;
        while damping < 1e9 && !is_better {
            let damped = matrix
                + DMat3::from_diagonal(
                    DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z) * damping,
                );
            let moved = place + damped.inverse() * right;
            match fit(lit, placed(moved)).filter(|fit| fit.error < best.error) {
                Some(better) => {
                    is_better = true;
                    (place, best) = (moved, better);
                    damping = (damping * 0.3).max(1e-12);
                }
                None => damping *= 4.0,
            }
        }
        if !is_better {
            break;
        }
    }
    Some(best)
}

/// A random source above the middle of a plane, and points around it.
fn random_source(seed: u64) -> (Source, Vec<DVec2>) {
    let mut sampler = Sampler::new(seed, 0, 0);
    let mut number = || sampler.number();
    let position = DVec3::new(number() - 0.5, number() - 0.5, 0.3 + number());
    // Within 60° of straight down.
    let (cosine, angle) = (0.5 + 0.5 * number(), 2.0 * PI * number());
    let sine = (1.0_f64 - cosine * cosine).sqrt();
    let normal = DVec3::new(sine * angle.cos(), sine * angle.sin(), -cosine);
    let source = Source { position, normal, flux: 100.0 * (0.5 + number()) };
    let points = (0..64).map(|i| DVec2::new((i % 8) as f64 - 3.5, (i / 8) as f64 - 3.5) * 0.4);
    (source, points.collect())
}

#[test]
fn sources_are_found_from_their_light() {
    let angle = |a: DVec3, b: DVec3| a.cross(b).length().atan2(a.dot(b)).to_degrees();
    for (noise, places, degrees, worst) in [(0.0, 1e-6, 1e-4, 1e-3), (0.01, 0.015, 1.5, 0.5)] {
        let (mut offs, mut turns, mut powers) = (Vec::new(), Vec::new(), Vec::new());
        for seed in 0..200 {
            let (source, points) = random_source(seed);
            let mut sampler = Sampler::new(seed, 1, 0);
            let mut gaussian = || {
                let [radius, at] = sampler.pair();
                (-2.0 * (1.0 - radius).ln()).sqrt() * (2.0 * PI * at).cos()
            };
            let light: Vec<Irradiance> = points
                .iter()
                .map(|point| {
                    let lux = source.lux(*point) * (1.0 + noise * gaussian());
                    Irradiance { point: *point, lux }
                })
                .collect();
            let found = Source::find(&light).expect("a source");
            assert!(found.position.z > 0.0, "above the plane, not mirrored");
            offs.push(found.position.distance(source.position));
            turns.push(angle(found.normal, source.normal));
            powers.push((found.flux / source.flux - 1.0).abs());
        }
        for values in [&mut offs, &mut turns, &mut powers] {
            values.sort_by(f64::total_cmp);
        }
        println!(
            "noise {noise}: medians {:.2e} m, {:.2e}°, flux {:.2e}; 95 %: {:.2e} m, {:.2e}°",
            offs[100], turns[100], powers[100], offs[190], turns[190]
        );
        assert!(offs[100] < places && turns[100] < degrees, "{} {}", offs[100], turns[100]);
        assert!(offs[190] < worst, "{}", offs[190]);
    }
}

/// The light that a lit patch leaves on a plane, by the shipped tracer: a virtual point light.
#[test]
fn a_lit_patch_is_found_from_the_tracers_image() {
    let (position, tilt) = (Vec3::new(0.2, 0.8, -0.1), Quat::from_rotation_z(0.4));
    let mut plane = MeshBuilder::new();
    let corner = |x: f32, z: f32| Vec3::new(x * 3.0, 0.0, z * 3.0);
    plane.quad([corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]);
    let mut patch = MeshBuilder::new();
    let corner = |x: f32, z: f32| position + tilt * Vec3::new(x * 0.02, 0.0, z * 0.02);
    patch.quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    let white = SceneMaterial { reflectance: 0.0, ..SceneMaterial::default() };
    let emissive =
        SceneMaterial { base_color: [0.0, 0.0, 0.0, 1.0], emissive: [1e5; 3], ..white.clone() };
    let scene = scene(vec![white, emissive], vec![plane, patch], &[]);
    let camera = View {
        pose: CameraPose::looking_at(Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO),
        vertical_fov_degrees: 36.0,
        near: 1e-3,
        size: UVec2::splat(16),
    };
    let settings = Settings {
        samples: 64,
        bounces: Some(0),
        shading: Shading::Lambertian,
        ..Settings::default()
    };
    let image = render(&scene, &camera, &settings, Watch::default()).expect("an image").extended;
    let light: Vec<Irradiance> = camera
        .rays()
        .iter()
        .zip(image.luminance())
        .map(|(ray, nits)| {
            let at = DVec3::new(0.0, 4.0, 0.0) - *ray * (4.0 / ray.y);
            // The plane of y = 0 as that of z = 0.
            Irradiance { point: DVec2::new(at.x, -at.z), lux: f64::from(nits) * PI }
        })
        // The camera sees the patch's dark back in the middle.
        .filter(|one| one.lux > 0.0 && one.point.distance(DVec2::new(0.2, 0.1)) > 0.3)
        .collect();
    let found = Source::find(&light).expect("a source");
    let normal = tilt * Vec3::NEG_Y;
    let exact = [
        DVec3::new(f64::from(position.x), -f64::from(position.z), f64::from(position.y)),
        DVec3::new(f64::from(normal.x), -f64::from(normal.z), f64::from(normal.y)),
    ];
    let off = found.position.distance(exact[0]);
    let turn = found.normal.angle_between(exact[1]).to_degrees();
    let flux = PI * 1e5 * 0.04 * 0.04;
    println!("{off:.4} m, {turn:.2}°, flux {:.4}", found.flux / flux);
    assert!(off < 0.03 && turn < 2.0 && (found.flux / flux - 1.0).abs() < 0.05, "{found:?}");
}

#[test]
fn odd_light_has_no_source_or_a_finite_one() {
    let at = |x: f64, lux: f64| Irradiance { point: DVec2::new(x, x * x), lux };
    assert!(Source::find(&[]).is_none());
    assert!(
        Source::find(&(0..9).map(|i| at(f64::from(i), f64::NAN)).collect::<Vec<_>>()).is_none()
    );
    let found = Source::find(&vec![at(0.0, 1.0); 9]);
    assert!(found.is_none_or(|found| found.position.is_finite()));
    let below = Source { position: DVec3::NEG_Z, normal: DVec3::Z, flux: 1.0 };
    assert_eq!(below.lux(DVec2::ZERO), 0.0);
    assert_eq!(Source { position: DVec3::ZERO, ..below }.lux(DVec2::ZERO), 0.0);
}

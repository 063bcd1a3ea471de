use std::f64::consts::{FRAC_PI_2, PI};

use super::*;
use crate::scene::SceneMaterial;
use crate::testing::fit_directions;

/// A level surface of the material's own values.
fn surface(material: &SceneMaterial) -> Surface<'_> {
    let [red, green, blue, _] = material.base_color.map(f64::from);
    Surface {
        position: DVec3::ZERO,
        geometric_normal: DVec3::Y,
        normal: DVec3::Y,
        base_color: DVec3::new(red, green, blue),
        metallic: f64::from(material.metallic),
        perceptual_roughness: f64::from(material.perceptual_roughness),
        emission: DVec3::ZERO,
        material,
    }
}

fn bsdf(material: &SceneMaterial, view_degrees: f64, shading: Shading) -> Bsdf {
    let surface = surface(material);
    let angle = view_degrees.to_radians();
    Bsdf::new(&surface, DVec3::new(angle.sin() * 0.6, angle.cos(), angle.sin() * 0.8), shading)
}

fn material(perceptual_roughness: f32, metallic: f32, reflectance: f32) -> SceneMaterial {
    SceneMaterial {
        perceptual_roughness,
        metallic,
        reflectance,
        base_color: [0.9, 0.6, 0.2, 1.0],
        ..SceneMaterial::default()
    }
}

fn materials() -> Vec<SceneMaterial> {
    vec![
        material(0.25, 1.0, 0.5),
        material(0.5, 0.0, 0.5),
        material(0.5, 0.5, 1.0),
        material(1.0, 1.0, 0.5),
        material(1.0, 0.0, 0.5),
        material(0.7, 0.0, 0.0),
    ]
}

/// ∫ over the hemisphere above +Y, by the midpoint rule in angles.
fn integrate(mut integrand: impl FnMut(DVec3) -> DVec3) -> DVec3 {
    let (rings, sectors) = (200, 400);
    let mut sum = DVec3::ZERO;
    for ring in 0..rings {
        let polar = FRAC_PI_2 * (f64::from(ring) + 0.5) / f64::from(rings);
        for sector in 0..sectors {
            let around = TAU * (f64::from(sector) + 0.5) / f64::from(sectors);
            sum += integrand(DVec3::new(
                polar.sin() * around.cos(),
                polar.cos(),
                polar.sin() * around.sin(),
            )) * polar.sin();
        }
    }
    sum * (FRAC_PI_2 / f64::from(rings)) * (TAU / f64::from(sectors))
}

#[test]
fn samples_agree_with_evaluation_and_densities_sum_to_one() {
    for (number, material) in materials().iter().enumerate() {
        for view in [0.0, 40.0, 75.0] {
            let bsdf = bsdf(material, view, Shading::Standard);
            let exact = integrate(|direction| bsdf.evaluate(direction).0);
            let covered = integrate(|direction| DVec3::splat(bsdf.evaluate(direction).1)).x;
            let count = 4096_u32;
            let (mut mean, mut square, mut kept) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for i in 0..count {
                let weight = bsdf.sample(&mut Sampler::new(number as u64, u64::from(i), 0)).map_or(
                    DVec3::ZERO,
                    |sample| {
                        kept += 1.0 / f64::from(count);
                        let (reflected, density) = bsdf.evaluate(sample.direction);
                        assert!(
                            (density - sample.density).abs() <= 1e-12 * density
                                && (reflected / density - sample.weight).length() < 1e-12
                        );
                        sample.weight
                    },
                );
                mean += weight / f64::from(count);
                square += weight * weight / f64::from(count);
            }
            // Four standard errors of the mean, and the error of the quadrature at a lobe a few
            // steps wide.
            let tolerance = 4.0
                * ((square - mean * mean).max(DVec3::ZERO) / f64::from(count)).map(f64::sqrt)
                + DVec3::splat(2e-3);
            assert!(
                ((mean - exact).abs() - tolerance).max_element() < 0.0,
                "material {number} at {view}°: {mean} for {exact}"
            );
            // Samples below the horizon are rejected; above it the density integrates to the
            // accepted share.
            assert!(
                (covered - kept).abs() < 4.0 * (0.25 / f64::from(count)).sqrt() + 2e-3,
                "material {number} at {view}°: {covered} {kept}"
            );
            assert!(covered < 1.0 + 2e-3);
        }
    }
}

#[test]
fn reflection_is_reciprocal() {
    let direction = |polar: f64, around: f64| {
        DVec3::new(polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin())
    };
    for material in &materials() {
        for (one, other) in
            [(direction(0.3, 0.0), direction(0.9, 2.0)), (direction(1.3, 1.0), direction(0.1, 4.0))]
        {
            let reflected = |view: DVec3, light: DVec3| {
                let surface = Surface { base_color: DVec3::ONE, ..surface(material) };
                Bsdf::new(&surface, view, Shading::Standard).evaluate(light).0 / light.y
            };
            assert!(
                (reflected(one, other) / reflected(other, one) - 1.0).abs().max_element() < 1e-9
            );
        }
    }
}

#[test]
fn a_metal_in_a_white_furnace_gains_no_energy() {
    for perceptual_roughness in [0.0, 0.1, 0.3, 0.6, 1.0] {
        for view in [0.0, 30.0, 60.0, 85.0, 89.9] {
            let white =
                SceneMaterial { perceptual_roughness, metallic: 1.0, ..SceneMaterial::default() };
            let bsdf = bsdf(&white, view, Shading::Standard);
            let count = 1024;
            let weights = (0..count).filter_map(|i| bsdf.sample(&mut Sampler::new(1, 0, i)));
            let mut sum = 0.0;
            for sample in weights {
                // Visible normals are sampled, so the weight is the share that other facets do not
                // shadow.
                assert!(sample.weight.max_element() <= 1.0 + 1e-9, "{}", sample.weight);
                sum += sample.weight.x / f64::from(count);
            }
            assert!(
                sum <= 1.0 + 1e-9 && sum > 0.3,
                "roughness {perceptual_roughness} at {view}°: {sum}"
            );
            assert!(
                perceptual_roughness > 0.3 || view > 80.0 || sum > 0.97,
                "roughness {perceptual_roughness} at {view}°: {sum}"
            );
        }
    }
}

#[test]
fn a_lambertian_reflects_its_albedo_and_nothing_below_the_horizon() {
    let material = SceneMaterial {
        base_color: [0.9, 0.6, 0.2, 1.0],
        metallic: 0.25,
        perceptual_roughness: 0.2,
        ..SceneMaterial::default()
    };
    let bsdf = bsdf(&material, 50.0, Shading::Lambertian);
    let exact = DVec3::new(0.9, 0.6, 0.2) * 0.75;
    for i in 0..64 {
        // The density is exactly proportional to BSDF × cosine: all samples have one weight.
        let weight = bsdf.sample(&mut Sampler::new(2, 0, i)).unwrap().weight;
        assert!((weight - exact).abs().max_element() < 1e-6, "{weight}");
    }
    let (reflected, density) = bsdf.evaluate(DVec3::new(0.6, 0.8, 0.0));
    assert!(
        (reflected - exact * 0.8 / PI).abs().max_element() < 1e-6
            && (density - 0.8 / PI).abs() < 1e-12
    );
    for direction in [DVec3::NEG_Y, DVec3::X, DVec3::new(0.8, -0.6, 0.0), DVec3::NAN] {
        assert_eq!(bsdf.evaluate(direction), (DVec3::ZERO, 0.0));
    }
}

#[test]
fn a_bent_normal_neither_leaks_nor_breaks() {
    // Views from both sides of the bent normal's horizon, lights all around.
    let material =
        SceneMaterial { perceptual_roughness: 0.3, metallic: 0.3, ..SceneMaterial::default() };
    for bend in [0.0, 30.0, 60.0, 89.0_f64] {
        let normal = DVec3::new(bend.to_radians().sin(), bend.to_radians().cos(), 0.0);
        let surface = Surface { normal, ..surface(&material) };
        for view in [-89.9, -45.0, 0.0, 45.0, 89.9_f64] {
            let view = DVec3::new(view.to_radians().sin(), view.to_radians().cos(), 0.0);
            let bsdf = Bsdf::new(&surface, view, Shading::Standard);
            for i in 0..256 {
                if let Some(sample) = bsdf.sample(&mut Sampler::new(3, 0, i)) {
                    assert!(
                        sample.direction.y > 0.0
                            && sample.weight.is_finite()
                            && sample.density.is_finite()
                    );
                }
            }
            for step in 0..36 {
                let angle = f64::from(step) * 10.0_f64.to_radians();
                let (reflected, density) = bsdf.evaluate(DVec3::new(angle.sin(), angle.cos(), 0.0));
                assert!(
                    reflected.is_finite() && density.is_finite() && reflected.min_element() >= 0.0
                );
                assert!(
                    angle.cos() > 0.0 || reflected == DVec3::ZERO,
                    "light from below at {angle}"
                );
            }
        }
    }
}

#[test]
fn sampled_directions_have_their_density() {
    let check = |name: &str, material: &SceneMaterial, normal: DVec3, view: f64, shading| {
        let (sine, cosine) = view.to_radians().sin_cos();
        let view = DVec3::new(sine * 0.6, cosine, sine * 0.8);
        let bsdf = Bsdf::new(&Surface { normal, ..surface(material) }, view, shading);
        let mirrored = normal * (2.0 * view.dot(normal)) - view;
        // Rings as narrow as the lobe.
        let focus = if material.perceptual_roughness < 0.3 { 8 } else { 2 };
        let sample = |sampler: &mut Sampler| bsdf.sample(sampler).map(|sample| sample.direction);
        let fit = fit_directions((mirrored, focus), sample, |to| bsdf.evaluate(to).1);
        fit.assert(&format!("{name} at {}°", view.angle_between(normal).to_degrees().round()));
    };
    for view in [0.0, 45.0, 75.0, 89.0] {
        let standard = |name: &str, material: SceneMaterial| {
            check(name, &material, DVec3::Y, view, Shading::Standard);
        };
        check("lambertian", &material(0.3, 0.0, 0.5), DVec3::Y, view, Shading::Lambertian);
        standard("diffuse", material(0.6, 0.0, 0.0));
        standard("dielectric", material(0.3, 0.0, 0.5));
        standard("mixed, smooth", material(0.2, 0.5, 0.5));
        standard("mixed, rough", material(0.7, 0.5, 1.0));
        for roughness in [0.0, 0.2, 0.4, 0.7, 1.0] {
            standard(&format!("metal {roughness}"), material(roughness, 1.0, 0.5));
        }
    }
    for bend in [20.0, 60.0_f64] {
        let normal = DVec3::new(-bend.to_radians().sin(), bend.to_radians().cos(), 0.0);
        for view in [30.0, 80.0] {
            check("bent normal", &material(0.5, 0.5, 0.5), normal, view, Shading::Standard);
        }
    }
}

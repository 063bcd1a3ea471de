//! Directions of BSDF and guide together against the number of samples per steradian.

use super::*;
use crate::bsdf::Shading;
use crate::guide::{Photon, around};
use crate::scene::SceneMaterial;
use crate::testing::fit_directions;

/// Photons at the origin, on a surface that faces up, from a disc of radius 0.8 m.
fn photons() -> Vec<Photon> {
    let photon = |i| {
        let mut sampler = Sampler::new(7, 0, i);
        let [x, z] = sampler.pair().map(|number| number as f32 * 0.02);
        let [radius, turn] = sampler.pair();
        let source = around(DVec3::Y, 0.0, turn) * (0.8 * radius.sqrt());
        Photon {
            position: Vec3::new(x, 0.0, z),
            normal: Vec3::Y,
            source: source.as_vec3() + Vec3::new(1.5, 1.5, 0.5),
            power: 1.0,
        }
    };
    (0..4000).map(photon).collect()
}

#[test]
fn samples_and_branches_have_the_expected_number_per_steradian() {
    let place = DVec3::new(0.01, 0.0, 0.01);
    let fields =
        [("spheres", Field::spheres(&mut photons())), ("bins", Field::histograms(&mut photons()))];
    for ((name, field), metallic, roughness) in [
        (&fields[0], 0.0, 1.0),
        (&fields[0], 1.0, 0.4),
        (&fields[1], 0.0, 1.0),
        (&fields[1], 0.5, 0.4),
    ] {
        let material = SceneMaterial::default();
        let surface = Surface {
            position: place,
            geometric_normal: DVec3::Y,
            normal: DVec3::Y,
            base_color: DVec3::splat(0.8),
            metallic,
            perceptual_roughness: roughness,
            emission: DVec3::ZERO,
            material: &material,
        };
        let view = DVec3::new(-0.6, 0.64, 0.48);
        let bsdf = Bsdf::new(&surface, view, Shading::Standard);
        let scatter = Scatter::new(bsdf, &surface, Some(field));
        let share = scatter.guide.as_ref().map_or(0.0, Aims::share);
        assert!(share > 0.05, "{name} take {share}");
        // Half of the samples each: the expected number may be above 1.
        let sample = |sampler: &mut Sampler| {
            let is_own = sampler.number() < 0.5;
            let to = if is_own { scatter.sample(sampler) } else { scatter.branch(sampler) }?;
            let density = scatter.evaluate(to.direction).1;
            assert!((to.density / density - 1.0).abs() < 1e-9, "{} for {density}", to.density);
            Some(to.direction)
        };
        let fit = fit_directions((view.reflect(DVec3::Y) * -1.0, 1), sample, |to| {
            0.5 * scatter.evaluate(to).1
        });
        fit.assert(&format!("{name}, metallic {metallic}"));
    }
}

//! Sampling of lights with extent: emissive triangles and the sky.

use glam::DVec3;

use super::scene::ReferenceScene;
use crate::bsdf::{Surface, is_cut_out};
use crate::light::EmitterPoint;
use crate::sampler::Sampler;

/// A point of an emissive triangle, or a direction of the sky.
pub(crate) struct Sampled {
    /// Towards it, unit length.
    pub(crate) direction: DVec3,
    /// Metres; infinite for the sky.
    pub(crate) distance: f64,
    /// Nits.
    pub(crate) radiance: DVec3,
    /// Per steradian, above 0.
    pub(crate) density: f64,
    /// Where it is; none for the sky.
    #[cfg_attr(not(feature = "media"), expect(dead_code, reason = "fog alone asks for places"))]
    pub(crate) point: Option<DVec3>,
}

/// A point of an emissive triangle that shines on `position`, metres.
pub(crate) fn emitter(
    scene: &ReferenceScene,
    position: DVec3,
    sampler: &mut Sampler,
) -> Option<Sampled> {
    if scene.emitters.is_empty() {
        return None;
    }
    let (choice, pair) = (sampler.number(), sampler.pair());
    shining(scene, &scene.emitters.sample(choice, pair)?, position)
}

/// What `point` is from `position`, if it shines there.
pub(super) fn shining(
    scene: &ReferenceScene,
    point: &EmitterPoint,
    position: DVec3,
) -> Option<Sampled> {
    let ray = point.position - position;
    let surface = Surface::new(&scene.geometry, &point.hit);
    let density = per_steradian(point.density, ray, surface.geometric_normal);
    let shines = ray.dot(surface.geometric_normal) < 0.0 || surface.material.double_sided;
    let counts =
        shines && density.is_finite() && density > 0.0 && !is_cut_out(&scene.geometry, &point.hit);
    counts.then(|| Sampled {
        direction: ray.normalize(),
        distance: ray.length(),
        radiance: surface.emission,
        density,
        point: Some(point.position),
    })
}

/// A direction of the sky.
pub(super) fn sky(scene: &ReferenceScene, sampler: &mut Sampler) -> Option<Sampled> {
    if !scene.sky.is_lit() {
        return None;
    }
    let (choice, pair) = (sampler.number(), sampler.pair());
    let sample = scene.sky.sample(choice, pair).filter(|sample| sample.density > 0.0)?;
    Some(Sampled {
        direction: sample.direction,
        distance: f64::INFINITY,
        radiance: sample.radiance,
        density: sample.density,
        point: None,
    })
}

/// Converts a density per m² on a surface with `normal` into a density per steradian at the start
/// of `ray` (metres), which ends on that surface.
pub(crate) fn per_steradian(per_square_metre: f64, ray: DVec3, normal: DVec3) -> f64 {
    let squared = ray.length_squared();
    per_square_metre * squared * squared.sqrt() / ray.dot(normal).abs().max(f64::MIN_POSITIVE)
}

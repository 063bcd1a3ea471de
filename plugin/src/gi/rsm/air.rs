//! What Bevy's atmosphere leaves of a sun's light, for the maps: Bevy's shading of surfaces has it
//! from a texture on the GPU.

use bevy::asset::Assets;
use bevy::camera::Camera3d;
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::light::Atmosphere;
use bevy::light::atmosphere::ScatteringMedium;
use bevy::math::{Vec2, Vec3};
use bevy::pbr::AtmosphereSettings;
use bevy::transform::components::GlobalTransform;

use super::map::RsmView;

/// Steps along a ray, as many as Bevy's by default.
const STEPS: u32 = 40;
/// Light is rounded to such a share of the sun's: while a camera moves, maps need not be rendered
/// again for what cannot be seen.
const STEP: f32 = 1.0 / 1024.0;

/// The atmospheres of the scene.
#[derive(SystemParam)]
pub(super) struct Atmospheres<'w, 's> {
    media: Option<Res<'w, Assets<ScatteringMedium>>>,
    all: Query<'w, 's, (Entity, &'static Atmosphere, &'static GlobalTransform), Without<RsmView>>,
    cameras: Query<'w, 's, (), (With<AtmosphereSettings>, With<Camera3d>)>,
}

/// An atmosphere around a camera.
#[derive(Clone, Copy)]
pub(super) struct Air<'a> {
    atmosphere: &'a Atmosphere,
    medium: &'a ScatteringMedium,
    /// In metres of the atmosphere, from the planet's centre.
    position: Vec3,
}

impl Atmospheres<'_, '_> {
    /// The one of a camera: the nearest, as Bevy's.
    pub(super) fn around(&self, camera: Entity, position: Vec3) -> Option<Air<'_>> {
        if !self.cameras.contains(camera) {
            return None;
        }
        let distance = |place: &GlobalTransform| place.translation().distance(position);
        let (_, atmosphere, place) = self.all.iter().min_by(|(a, _, near), (b, _, far)| {
            distance(near).total_cmp(&distance(far)).then(a.cmp(b))
        })?;
        let medium = self.media.as_ref()?.get(&atmosphere.medium)?;
        // A planet has no orientation.
        let (scale, _, center) = place.to_scale_rotation_translation();
        Some(Air { atmosphere, medium, position: (position - center) / scale })
    }
}

impl Air<'_> {
    /// Share of a sun's light that arrives, linear RGB. `toward`: unit vector to the sun; `size`: of its
    /// disk, radians.
    pub(super) fn sunlight(&self, toward: Vec3, size: f32) -> Vec3 {
        let Atmosphere { inner_radius, outer_radius, .. } = *self.atmosphere;
        let up = self.position.normalize_or(Vec3::Y);
        let radius = self.position.length().max(inner_radius);
        let cosine = up.dot(toward);
        let share = (self.transmittance(radius, cosine)
            * visible(inner_radius / radius, cosine, size))
        .clamp(Vec3::ZERO, Vec3::ONE);
        let is_known = share.is_finite() && outer_radius > inner_radius;
        if is_known { (share / STEP).round() * STEP } else { Vec3::ONE }
    }

    /// Of a ray to the border of the atmosphere, from `radius` at the `cosine` to straight up.
    fn transmittance(&self, radius: f32, cosine: f32) -> Vec3 {
        let Atmosphere { inner_radius, outer_radius, .. } = *self.atmosphere;
        let discriminant = radius * radius * (cosine * cosine - 1.0) + outer_radius * outer_radius;
        let length = (discriminant.max(0.0).sqrt() - radius * cosine).max(0.0);
        let step = length / STEPS as f32;
        let depth: Vec3 = (0..STEPS)
            .map(|index| {
                let along = (index as f32 + 0.5) * step;
                let place = Vec2::new(
                    radius + along * cosine,
                    along * (1.0 - cosine * cosine).max(0.0).sqrt(),
                );
                let altitude = (place.length() - inner_radius) / (outer_radius - inner_radius);
                let falloff = 1.0 - altitude.clamp(0.0, 1.0);
                let terms = self.medium.terms.iter();
                terms
                    .map(|term| (term.absorption + term.scattering) * term.falloff.sample(falloff))
                    .sum::<Vec3>()
            })
            .sum();
        (-depth * step).exp()
    }
}

/// Share of the sun's disk above the horizon. `sine`: of the angle under which half the planet is seen.
fn visible(sine: f32, cosine: f32, size: f32) -> f32 {
    let horizon = (-(1.0 - sine * sine).max(0.0).sqrt()).acos();
    let above = horizon - cosine.clamp(-1.0, 1.0).acos();
    // A sun without size sets at once.
    (0.5 + above / size.max(1e-6)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use bevy::asset::Handle;

    use super::*;

    #[test]
    fn the_sun_reddens_sets_and_stays_set() {
        let (atmosphere, medium) =
            (Atmosphere::earth(Handle::default()), ScatteringMedium::earth(64, 64));
        let air = |altitude: f32| {
            let position = Vec3::Y * (atmosphere.inner_radius + altitude);
            Air { atmosphere: &atmosphere, medium: &medium, position }
        };
        let at = |degrees: f32| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            air(1.0).sunlight(Vec3::new(cosine, sine, 0.0), 0.0093)
        };
        let noon = at(90.0);
        assert!(noon.min_element() > 0.6 && noon.x > noon.z && noon.x < 1.0, "{noon}");
        let evening = at(3.0);
        assert!(evening.x < 0.5 * noon.x && evening.z < 0.3 * evening.x, "{evening}");
        assert_eq!(at(-2.0), Vec3::ZERO);
        assert_eq!(at(-90.0), Vec3::ZERO);
        let space = air(200_000.0).sunlight(Vec3::Y, 0.0093);
        assert_eq!(space, Vec3::ONE, "above the air");
        // Within a step the light of a camera that moves is the same.
        assert_eq!(air(1.0).sunlight(Vec3::Y, 0.0093), air(3.0).sunlight(Vec3::Y, 0.0093));
        let broken = Air { position: Vec3::NAN, ..air(1.0) };
        assert_eq!(broken.sunlight(Vec3::Y, 0.0093), noon, "as if on the ground");
    }
}

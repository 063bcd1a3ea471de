//! What lights GI cameras: whether there is light to gather, without which GI holds no buffers, and a
//! camera's environment map; and which meshes they show, by render layers and by level of detail.

use bevy::asset::AssetId;
use bevy::camera::Camera;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{RenderLayers, VisibilityRange};
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight};
use bevy::math::{Quat, Vec3};
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;
use bevy::transform::components::GlobalTransform;

use super::ActiveGi;
use crate::gi::settings::FrugalGi;

/// The kinds of light in the scene, in the main world. Written in
/// [`SceneSystems::Maps`](crate::gi::schedule::SceneSystems) and `Emissive`.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct LightPresence {
    /// There are reflective shadow maps.
    pub maps: bool,
    /// There are texels of emissive surfaces.
    pub emissive: bool,
}

impl LightPresence {
    /// Whether a camera has light to gather: of lights, of emissive surfaces, or of its environment
    /// map where it has one.
    pub(crate) fn lights(&self, gi: &FrugalGi, has_environment_map: bool) -> bool {
        self.maps
            || gi.emissive && self.emissive
            || has_environment_map && gi.environment_samples > 0
    }
}

/// A GI camera's environment map, as its app set it.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct SkySource {
    pub diffuse: AssetId<Image>,
    pub specular: AssetId<Image>,
    /// Nits per unit of the map.
    pub intensity: f32,
    pub rotation: Quat,
    /// Whether the renderer generates the map in each frame.
    pub is_generated: bool,
}

/// Extracts GI cameras' environment maps into the render world.
pub(super) fn extract_environments(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, Option<&EnvironmentMapLight>), With<FrugalGi>>>,
    generated: Extract<Query<&EnvironmentMapLight, With<GeneratedEnvironmentMapLight>>>,
) {
    for (entity, environment) in &cameras {
        let Ok(mut entity) = commands.get_entity(entity) else { continue };
        match environment {
            Some(environment) => entity.insert(SkySource {
                diffuse: environment.diffuse_map.id(),
                specular: environment.specular_map.id(),
                intensity: environment.intensity,
                rotation: environment.rotation,
                // Its own, or that of another camera or a light probe.
                is_generated: generated
                    .iter()
                    .any(|other| other.specular_map == environment.specular_map),
            }),
            None => entity.remove::<SkySource>(),
        };
    }
}

/// The active GI cameras of the main world.
#[derive(SystemParam)]
pub(in crate::gi) struct GiCameras<'w, 's> {
    cameras: Query<
        'w,
        's,
        (
            &'static Camera,
            &'static ActiveGi,
            &'static GlobalTransform,
            Option<&'static RenderLayers>,
        ),
    >,
}

impl GiCameras<'_, '_> {
    /// What they show together.
    pub(crate) fn shown(&self) -> VisibilityFilter {
        let mut shown = VisibilityFilter { layers: RenderLayers::none(), eyes: Vec::new() };
        for (camera, gi, transform, layers) in &self.cameras {
            if camera.is_active && gi.vpl_count > 0 {
                shown.layers = shown.layers.union(layers.unwrap_or_default());
                shown.eyes.push(transform.translation());
            }
        }
        shown
    }
}

/// What decides whether a camera shows a mesh.
#[derive(QueryData)]
pub(in crate::gi) struct MeshVisibility {
    layers: Option<&'static RenderLayers>,
    range: Option<&'static VisibilityRange>,
    aabb: Option<&'static Aabb>,
}

/// What the active GI cameras show.
pub(in crate::gi) struct VisibilityFilter {
    layers: RenderLayers,
    eyes: Vec<Vec3>,
}

impl VisibilityFilter {
    /// Render layers of all of them.
    pub(crate) fn layers(&self) -> &RenderLayers {
        &self.layers
    }

    /// Whether a mesh is on a layer, and at a level of detail, of any GI camera.
    pub(crate) fn has(&self, mesh: &MeshVisibilityItem, transform: &GlobalTransform) -> bool {
        self.layers.intersects(mesh.layers.unwrap_or_default())
            && mesh.range.is_none_or(|range| self.has_level(range, mesh.aabb, transform))
    }

    /// Whether a level of detail is the one at the distance of a GI camera. While two levels fade
    /// into each other it is the one that shows more, so that a single one counts.
    fn has_level(
        &self,
        range: &VisibilityRange,
        aabb: Option<&Aabb>,
        transform: &GlobalTransform,
    ) -> bool {
        let position = level_position(range, aabb, transform);
        let middle = |margin: &std::ops::Range<f32>| 0.5 * (margin.start + margin.end);
        let (from, to) = (middle(&range.start_margin), middle(&range.end_margin));
        self.eyes.iter().any(|eye| (from..to).contains(&eye.distance(position)))
    }
}

/// Where a mesh is whose distance decides on its level of detail, as Bevy has it.
pub(in crate::gi) fn level_position(
    range: &VisibilityRange,
    aabb: Option<&Aabb>,
    transform: &GlobalTransform,
) -> Vec3 {
    match aabb {
        Some(aabb) if range.use_aabb => transform.affine().transform_point3a(aabb.center).into(),
        _ => transform.translation(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_level_of_detail_counts_at_any_distance() {
        let levels = [
            VisibilityRange { start_margin: 0.0..0.0, end_margin: 20.0..25.0, use_aabb: false },
            VisibilityRange { start_margin: 20.0..25.0, end_margin: 70.0..75.0, use_aabb: false },
            VisibilityRange::abrupt(72.5, f32::INFINITY),
        ];
        let place = GlobalTransform::from_xyz(1.0, 0.0, 0.0);
        for distance in [0.0, 10.0, 20.0, 22.4, 22.5, 25.0, 69.0, 72.4, 72.5, 75.0, 1e9] {
            let eyes = vec![Vec3::new(1.0, distance, 0.0)];
            let shown = VisibilityFilter { layers: RenderLayers::default(), eyes };
            let count = levels.iter().filter(|level| shown.has_level(level, None, &place)).count();
            assert_eq!(count, 1, "at {distance} m");
        }
        let lost = VisibilityFilter { layers: RenderLayers::default(), eyes: vec![Vec3::NAN] };
        assert!(!lost.has_level(&levels[0], None, &place));
    }
}

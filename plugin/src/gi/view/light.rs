//! What lights GI cameras: whether there is light to gather, without which GI holds no buffers, and a
//! camera's environment map.

use bevy::app::App;
use bevy::asset::AssetId;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight};
use bevy::math::Quat;
use bevy::render::sync_world::RenderEntity;
use bevy::render::{Extract, ExtractSchedule};

use crate::gi::schedule::supported_render_app;
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

pub(super) fn finish(app: &mut App) {
    if let Some(render_app) = supported_render_app(app) {
        render_app.add_systems(ExtractSchedule, extract_environments);
    }
}

/// Extracts GI cameras' environment maps into the render world.
fn extract_environments(
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

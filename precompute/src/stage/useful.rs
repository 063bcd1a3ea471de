//! Knobs that affect a scene.

use bevy::app::App;
use bevy_frugal_gi::knobs::{KnobPlugin, KnobRegistry};
use frugal_core::knobs::KnobSpace;
use frugal_trace::light::Light;

use crate::scene::LoadedScene;

/// Names of the built-in knobs that can affect images of `scene`. All levels of the others look and
/// cost the same, and would only lengthen the search.
pub(crate) fn useful_knobs(scene: &LoadedScene) -> Vec<String> {
    let geometry = &scene.geometry;
    let has_light = !scene.lights.is_empty();
    let has_sun = scene.lights.iter().any(|light| matches!(light, Light::Directional { .. }));
    let has_environment = scene.environment.sends_light();
    let has_emissive = geometry.materials.iter().any(|material| material.emissive != [0.0; 3]);
    let space = knobs();
    // From a corner, the shortest view distance may leave out the opposite one.
    let is_wide = || {
        let share = space.value(space.lowest(), "view_distance").unwrap_or(1.0);
        geometry.meshes.len() > 1
            && geometry
                .bounds()
                .is_some_and(|bounds| bounds.size().length() > share as f32 * scene.camera.far)
    };
    let useful = |name: &str| match name {
        // Only the camera moves in a scene file.
        "gi_refresh_period" => false,
        // Nor does it ask for reflections, contact shadows or fog.
        "effects" => false,
        "view_distance" => is_wide(),
        "rsm_resolution" | "shadow_map_resolution" => has_light,
        "gi_environment_samples" => has_environment,
        name if name.starts_with("gi_") => has_light || has_emissive || has_environment,
        "shadow_cascades" => has_sun,
        // Bevy's loader makes no mip levels.
        "texture_detail" => false,
        // Beside environment light it dims only indirect light without rays.
        "ambient_occlusion" => has_environment,
        _ => true,
    };
    space.knobs().iter().map(|knob| knob.name.clone()).filter(|name| useful(name)).collect()
}

/// All built-in knobs except the opt-in ones.
pub(crate) fn knobs() -> KnobSpace {
    built_in(false)
}

/// All built-in knobs.
pub fn every_knob() -> KnobSpace {
    built_in(true)
}

fn built_in(with_opt_in: bool) -> KnobSpace {
    let mut app = App::new();
    app.add_plugins(KnobPlugin);
    let registry = app.world().resource::<KnobRegistry>();
    registry.space_with(|_| with_opt_in).expect("the built-in knobs are valid")
}

//! Which knobs a scene has a use for.

use bevy_frugal_gi::knobs::KnobSpace;

use super::StageError;
use crate::scene::{Environment, Light, SceneDescription};

/// Names of the built-in knobs that can change an image of `scene`. The others' levels all look and
/// cost the same, and would only make the search longer.
///
/// # Errors
/// When the scene's geometry cannot be read.
pub fn useful_knobs(scene: &SceneDescription) -> Result<Vec<String>, StageError> {
    let geometry = scene.geometry()?;
    let has_light = !scene.lights.is_empty();
    let has_sun = scene.lights.iter().any(|light| matches!(light, Light::Directional { .. }));
    let has_texture =
        geometry.materials.iter().any(|material| material.base_color_texture.is_some());
    let lit_from_around = match &scene.environment {
        Environment::None => false,
        Environment::Constant(radiance) => *radiance != [0.0; 3],
        Environment::Map(_, intensity) => *intensity > 0.0,
    };
    let has_glow = geometry.materials.iter().any(|material| material.emissive != [0.0; 3]);
    let useful = |name: &str| match name {
        // Nothing in a scene file moves but the camera.
        "gi_refresh_period" => false,
        "rsm_resolution" | "shadow_map_resolution" => has_light,
        "gi_environment_samples" => lit_from_around,
        name if name.starts_with("gi_") => has_light || has_glow || lit_from_around,
        "shadow_cascades" => has_sun,
        "texture_detail" => has_texture,
        // It darkens light from around alone.
        "ambient_occlusion" => lit_from_around,
        _ => true,
    };
    Ok(knobs()?.knobs().iter().map(|knob| knob.name.clone()).filter(|name| useful(name)).collect())
}

/// Every knob that a stage has and that need not be named.
///
/// # Errors
/// Never, as long as the built-in knobs are sound.
pub fn knobs() -> Result<KnobSpace, StageError> {
    Ok(super::app::knobs(false)?)
}

/// Every knob that a stage has.
///
/// # Errors
/// Never, as long as the built-in knobs are sound.
pub fn every_knob() -> Result<KnobSpace, StageError> {
    Ok(super::app::knobs(true)?)
}

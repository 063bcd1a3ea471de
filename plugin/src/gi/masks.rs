//! Keeps Bevy 0.19.1 from drawing deferred alpha-masked meshes twice.
//!
//! They are drawn into the G-buffer and lit by the deferred pass. The forward alpha-mask pass then
//! draws them again over that, without direct light (a drape in the sun came out black). Bevy
//! leaves opaque deferred materials out of the forward pass; this does the same for masked ones. It
//! matters here because [`GiPlugin`](super::GiPlugin) makes deferred rendering the default and
//! gives every camera a deferred prepass.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::material::labels::DrawFunctionLabel;
use bevy::material::{OpaqueRendererMethod, RenderPhaseType};
use bevy::pbr::{MainPassAlphaMaskDrawFunction, PreparedMaterial};
use bevy::render::erased_render_asset::ErasedRenderAssets;

/// Takes the forward pass's draw function away from deferred alpha-masked materials, before meshes
/// are queued for drawing.
pub(super) fn draw_once(mut materials: ResMut<ErasedRenderAssets<PreparedMaterial>>) {
    if !materials.is_changed() {
        return;
    }
    let forward = MainPassAlphaMaskDrawFunction.intern();
    // This change must not trigger change detection in the next frame.
    for (_, material) in materials.bypass_change_detection().iter_mut() {
        let properties = &material.properties;
        let is_masked = matches!(properties.render_phase_type, RenderPhaseType::AlphaMask);
        if !is_masked
            || properties.render_method != OpaqueRendererMethod::Deferred
            || properties.get_draw_function(forward).is_none()
        {
            continue;
        }
        match Arc::get_mut(&mut material.properties) {
            Some(properties) => properties.draw_functions.retain(|(label, _)| *label != forward),
            None => warn_once!(
                "a deferred alpha-masked material is shared and stays drawn twice: it may lack direct light"
            ),
        }
    }
}

//! Per-camera resolution scale: everything up to post-processing is rendered at a smaller size,
//! then upscaled with a filter.
//!
//! Bevy 0.19's own mechanisms do not work for a deferred camera: no shader reads its resolution
//! override, and a smaller viewport breaks ambient occlusion. So this module gives the extracted
//! camera a smaller size, no viewport, and textures of its own (`scaled`), before Bevy makes any.
//! Its own pass filters the image into the target, or the viewport's part of it, in place of Bevy's
//! blit (`upscale`). At scale 1 none of that applies, and the image is bit-identical to Bevy's.

mod scaled;
mod upscale;

use bevy::core_pipeline::schedule::{Core2d, Core2dSystems, Core3d, Core3dSystems};
use bevy::core_pipeline::upscaling::upscaling;
use bevy::prelude::*;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::view::{prepare_view_attachments, prepare_view_targets};
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub(crate) use scaled::ScaledView;

/// Rendered size as a fraction of the target's width and height, in [0.1, 1]; clamped, NaN counts
/// as 1. Default: 1.
///
/// Higher values are sharper, at a cost that grows with the square; lower values are cheaper and
/// softer. 1 is native. A camera with a viewport is scaled within it. User interface drawn by the
/// same camera is scaled too: give it a camera of its own.
///
/// Several cameras may draw on one target, each at a scale of its own. A scaled camera has textures
/// of its own: where it clears nothing, it starts from transparent black and is blended over the
/// cameras before it, whose image it does not read.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Clone, PartialEq)]
#[extract_component_sync_target((Self, ScaledView, upscale::UpscalePipelineId))]
pub struct ResolutionScale(pub f32);

impl Default for ResolutionScale {
    fn default() -> Self {
        Self(1.0)
    }
}

impl ResolutionScale {
    /// The rendered size, in pixels, for a target of `size` pixels: at least 1 × 1 for a target
    /// that is not empty, and at most `size`.
    pub fn apply(self, size: UVec2) -> UVec2 {
        let scale = if self.0.is_nan() { 1.0 } else { self.0.clamp(0.1, 1.0) };
        (size.as_vec2() * scale).round().as_uvec2().max(UVec2::ONE).min(size)
    }
}

/// Adds the systems and the pass of [`ResolutionScale`].
#[derive(Clone, Debug, Default)]
pub struct ResolutionPlugin;

impl Plugin for ResolutionPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "upscale.wgsl");
        app.register_type::<ResolutionScale>()
            .add_plugins(ExtractComponentPlugin::<ResolutionScale>::default());
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .init_gpu_resource::<upscale::UpscalePipelines>()
            .add_systems(
                Render,
                (
                    // Need the extracted sizes, before any texture is allocated from them.
                    scaled::shrink_views
                        .after(RenderSystems::ExtractCommands)
                        .before(RenderSystems::CreateViews),
                    // Textures are shared by target. Needs the target's attachment.
                    scaled::separate_targets
                        .in_set(RenderSystems::PrepareViews)
                        .after(prepare_view_attachments)
                        .before(prepare_view_targets),
                    upscale::prepare_pipelines.in_set(RenderSystems::Prepare),
                    // Skipping before view targets are prepared would leave the camera without one.
                    (scaled::rejoin_targets, upscale::take_over_output)
                        .in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(
                Core3d,
                upscale::upscale.after(Core3dSystems::PostProcess).before(upscaling),
            )
            .add_systems(
                Core2d,
                upscale::upscale.after(Core2dSystems::PostProcess).before(upscaling),
            );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scale_gives_a_size_inside_the_target() {
        let size = UVec2::new(321, 1);
        for scale in
            [f32::NAN, f32::NEG_INFINITY, -1.0, 0.0, 0.1, 0.5, 0.999, 1.0, 2.0, f32::INFINITY]
        {
            let scaled = ResolutionScale(scale).apply(size);
            assert!(
                scaled.cmpge(UVec2::ONE).all() && scaled.cmple(size).all(),
                "{scale}: {scaled}"
            );
        }
        assert_eq!(ResolutionScale(0.5).apply(UVec2::new(320, 180)), UVec2::new(160, 90));
        assert_eq!(ResolutionScale(1.0).apply(size), size);
    }
}

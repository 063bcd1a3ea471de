//! Per-camera resolution scale: everything up to post-processing is rendered at a smaller size,
//! then upscaled with a filter.
//!
//! Bevy 0.19's own mechanisms do not work for a deferred camera: no shader reads its resolution
//! override, and a smaller viewport breaks ambient occlusion. So this module gives the extracted
//! camera a smaller size before any of its textures is made, and its own pass writes the target in
//! place of Bevy's unfiltered blit. At scale 1 neither applies, and the image is bit-identical to
//! Bevy's.

use bevy::app::{App, Plugin};
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::camera::CameraOutputMode;
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::core_pipeline::upscaling::upscaling;
use bevy::ecs::prelude::*;
use bevy::math::{UVec2, UVec4};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::render_resource::binding_types::{sampler, texture_2d};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ExtractedView, ViewTarget};
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy::shader::Shader;
use bevy::utils::default;

/// Rendered size as a fraction of the target's width and height, in [0.1, 1]; clamped, NaN counts
/// as 1. Default: 1.
///
/// Higher values are sharper, at a cost that grows with the square; lower values are cheaper and
/// softer. 1 is native. Has no effect on a camera with a viewport. User interface drawn by the same
/// camera is scaled too: give it a camera of its own.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Clone, PartialEq)]
#[extract_component_sync_target((Self, UpscalePipelineId))]
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
        embedded_asset!(app, "upscale.wgsl");
        app.register_type::<ResolutionScale>()
            .add_plugins(ExtractComponentPlugin::<ResolutionScale>::default());
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .init_gpu_resource::<UpscalePipelines>()
            .add_systems(
                Render,
                (
                    // Need the extracted sizes, before any texture is allocated from them.
                    shrink_views
                        .after(RenderSystems::ExtractCommands)
                        .before(RenderSystems::CreateViews),
                    prepare_pipelines.in_set(RenderSystems::Prepare),
                    // Skipping before view targets are prepared would leave the camera without one.
                    take_over_output.in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(Core3d, upscale.after(Core3dSystems::PostProcess).before(upscaling));
    }
}

/// Upscaling pipeline of a camera that is rendered at a smaller size in this frame; in the render
/// world.
#[derive(Component)]
pub struct UpscalePipelineId(CachedRenderPipelineId);

fn shrink_views(mut views: Query<(&mut ExtractedCamera, &mut ExtractedView, &ResolutionScale)>) {
    for (mut camera, mut view, scale) in &mut views {
        let (Some(size), None) = (camera.physical_target_size, &camera.viewport) else { continue };
        let scaled = scale.apply(size);
        if scaled != size {
            camera.physical_target_size = Some(scaled);
            camera.physical_viewport_size = Some(scaled);
            view.viewport = UVec4::new(0, 0, scaled.x, scaled.y);
        }
    }
}

fn is_shrunk(camera: &ExtractedCamera, scale: ResolutionScale) -> bool {
    // A camera with a viewport is not scaled.
    camera.viewport.is_none() && scale.0 < 1.0
}

#[derive(Resource)]
struct UpscalePipelines {
    layout: BindGroupLayoutDescriptor,
    shader: bevy::asset::Handle<Shader>,
    vertex: VertexState,
    sampler: Sampler,
}

impl FromWorld for UpscalePipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/upscale",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    texture_2d(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                ),
            ),
        );
        world.init_resource::<SpecializedRenderPipelines<UpscalePipelines>>();
        let sampler = world.resource::<RenderDevice>().create_sampler(&SamplerDescriptor {
            label: Some("bevy_frugal_gi/upscale"),
            min_filter: FilterMode::Linear,
            mag_filter: FilterMode::Linear,
            ..default()
        });
        let vertex = world.resource::<FullscreenShader>().to_vertex_state();
        Self { layout, shader: load_embedded_asset!(world, "upscale.wgsl"), vertex, sampler }
    }
}

impl SpecializedRenderPipeline for UpscalePipelines {
    type Key = TextureFormat;

    fn specialize(&self, target_format: TextureFormat) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some("bevy_frugal_gi/upscale".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                entry_point: Some("upscale".into()),
                targets: vec![Some(ColorTargetState {
                    format: target_format,
                    blend: None,
                    write_mask: ColorWrites::ALL,
                })],
                ..default()
            }),
            ..default()
        }
    }
}

fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    mut specialized: ResMut<SpecializedRenderPipelines<UpscalePipelines>>,
    pipelines: Res<UpscalePipelines>,
    views: Query<(Entity, &ExtractedCamera, &ResolutionScale, &ViewTarget)>,
) {
    for (entity, camera, scale, target) in &views {
        let Some(format) = target.out_texture_view_format() else { continue };
        // Queued in the first frame, also at scale 1, so that no later switch waits for it.
        let pipeline = specialized.specialize(&cache, &pipelines, format);
        if is_shrunk(camera, *scale) {
            commands.entity(entity).insert(UpscalePipelineId(pipeline));
        } else {
            commands.entity(entity).remove::<UpscalePipelineId>();
        }
    }
}

fn take_over_output(
    cache: Res<PipelineCache>,
    mut views: Query<(&mut ExtractedCamera, &UpscalePipelineId)>,
) {
    for (mut camera, pipeline) in &mut views {
        // Until our pipeline is compiled, Bevy's unfiltered blit writes the target.
        if cache.get_render_pipeline(pipeline.0).is_some() {
            camera.output_mode = CameraOutputMode::Skip;
        }
    }
}

fn upscale(
    view: ViewQuery<(&ViewTarget, &UpscalePipelineId)>,
    pipelines: Res<UpscalePipelines>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (target, pipeline) = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(pipeline.0) else { return };
    let Some(attachment) = target.out_texture_color_attachment(None) else { return };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/upscale",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((target.main_texture_view(), &pipelines.sampler)),
    );
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/upscale");
    {
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bevy_frugal_gi/upscale"),
            color_attachments: &[Some(attachment)],
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
    span.end(context.command_encoder());
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

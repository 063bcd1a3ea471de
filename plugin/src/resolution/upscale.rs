//! The pass that writes a scaled camera's image to its target.

use bevy::asset::load_embedded_asset;
use bevy::camera::CameraOutputMode;
use bevy::core_pipeline::FullscreenShader;
use bevy::prelude::*;
use bevy::render::camera::{ExtractedCamera, SortedCameras};
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{sampler, texture_2d};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewTarget, ViewTargetAttachments};

use super::ResolutionScale;
use super::scaled::{ScaledView, is_over_another};

/// Upscaling pipeline of a camera that is rendered at a smaller size in this frame, and the color
/// that its target is cleared with if no camera has written it yet; in the render world.
#[derive(Component)]
pub struct UpscalePipelineId(CachedRenderPipelineId, ClearColorConfig);

#[derive(Resource)]
pub(super) struct UpscalePipelines {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    vertex: VertexState,
    sampler: Sampler,
}

impl FromWorld for UpscalePipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "frugal_gi/upscale",
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
            label: Some("frugal_gi/upscale"),
            min_filter: FilterMode::Linear,
            mag_filter: FilterMode::Linear,
            ..default()
        });
        let vertex = world.resource::<FullscreenShader>().to_vertex_state();
        Self { layout, shader: load_embedded_asset!(world, "upscale.wgsl"), vertex, sampler }
    }
}

impl SpecializedRenderPipeline for UpscalePipelines {
    type Key = (TextureFormat, Option<BlendState>);

    fn specialize(&self, (target_format, blend): Self::Key) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some("frugal_gi/upscale".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                entry_point: Some("upscale".into()),
                targets: vec![Some(ColorTargetState {
                    format: target_format,
                    blend,
                    write_mask: ColorWrites::ALL,
                })],
                ..default()
            }),
            ..default()
        }
    }
}

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    sorted: Res<SortedCameras>,
    mut specialized: ResMut<SpecializedRenderPipelines<UpscalePipelines>>,
    pipelines: Res<UpscalePipelines>,
    views: Query<(Entity, &ExtractedCamera, Has<ScaledView>, &ViewTarget), With<ResolutionScale>>,
) {
    for (entity, camera, is_scaled, target) in &views {
        let id = match (target.out_texture_view_format(), camera.output_mode) {
            (Some(format), CameraOutputMode::Write { blend_state, clear_color }) => {
                // The image of a camera over another is premultiplied: it was drawn on transparent
                // black.
                let over = is_over_another(entity, &sorted)
                    .then_some(BlendState::PREMULTIPLIED_ALPHA_BLENDING);
                // Queued in the first frame, also at scale 1, so that no later switch waits for it.
                let key = (format, blend_state.or(over));
                let pipeline = specialized.specialize(&cache, &pipelines, key);
                is_scaled.then_some(UpscalePipelineId(pipeline, clear_color))
            }
            _ => None,
        };
        match id {
            Some(id) => commands.entity(entity).insert(id),
            None => commands.entity(entity).remove::<UpscalePipelineId>(),
        };
    }
}

pub(super) fn take_over_output(
    cache: Res<PipelineCache>,
    mut views: Query<(&mut ExtractedCamera, &UpscalePipelineId), With<ScaledView>>,
) {
    for (mut camera, pipeline) in &mut views {
        // Until our pipeline is compiled, Bevy's unfiltered blit writes the target.
        if cache.get_render_pipeline(pipeline.0).is_some() {
            camera.output_mode = CameraOutputMode::Skip;
        }
    }
}

pub(super) fn upscale(
    view: ViewQuery<(&ViewTarget, &ExtractedCamera, &UpscalePipelineId, &ScaledView)>,
    attachments: Res<ViewTargetAttachments>,
    pipelines: Res<UpscalePipelines>,
    global_clear_color: Res<ClearColor>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (target, camera, UpscalePipelineId(pipeline, clear_color), part) = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(*pipeline) else { return };
    // As Bevy's blit does. Only the first camera of a target clears it.
    let clear_color = match clear_color {
        ClearColorConfig::Default => Some(global_clear_color.0),
        ClearColorConfig::Custom(color) => Some(*color),
        ClearColorConfig::None => None,
    };
    // Not the view's own, a copy: Bevy may have put another in its place since, for a screenshot.
    let Some(output) = camera.target.as_ref().and_then(|target| attachments.get(target)) else {
        return;
    };
    let attachment = output.get_attachment(clear_color.map(Into::into));
    let bind_group = context.render_device().create_bind_group(
        "frugal_gi/upscale",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((target.main_texture_view(), &pipelines.sampler)),
    );
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "frugal_gi/upscale");
    {
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("frugal_gi/upscale"),
            color_attachments: &[Some(attachment)],
            ..default()
        });
        let (position, size) = (part.position.as_vec2(), part.size.as_vec2());
        pass.set_viewport(position.x, position.y, size.x, size.y, 0.0, 1.0);
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
    span.end(context.command_encoder());
}

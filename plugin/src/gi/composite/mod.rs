//! The composite: irradiance, upsampled along surfaces, times albedo, added to the image before
//! tone mapping.

use bevy::app::{App, Plugin};
use bevy::asset::{Handle, embedded_asset, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ExtractedView, ViewTarget, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render, RenderSystems};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

use super::gather::GatherView;
use super::schedule::{GiSystems, supported_render_app};
use super::settings::{FrugalGi, GiOutput, GiPixelFraction, GiShading};
use super::view::GiView;

pub(super) struct CompositePlugin;

impl Plugin for CompositePlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "composite.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<CompositePipelines>()
            .add_systems(Render, prepare_pipelines.in_set(RenderSystems::Prepare))
            .add_systems(Core3d, composite.in_set(GiSystems::Composite));
    }
}

#[derive(Resource)]
pub(super) struct CompositePipelines {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    vertex: VertexState,
}

impl FromWorld for CompositePipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/composite",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    texture_2d(TextureSampleType::Float { filterable: false }),
                ),
            ),
        );
        world.init_resource::<SpecializedRenderPipelines<CompositePipelines>>();
        let vertex = world.resource::<FullscreenShader>().to_vertex_state();
        Self { layout, vertex, shader: load_embedded_asset!(world, "composite.wgsl") }
    }
}

/// Key of a composite pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct CompositeKey {
    fraction: GiPixelFraction,
    shading: GiShading,
    target_format: TextureFormat,
}

impl SpecializedRenderPipeline for CompositePipelines {
    type Key = CompositeKey;

    fn specialize(&self, key: CompositeKey) -> RenderPipelineDescriptor {
        let (width, height) = key.fraction.cell();
        let mut shader_defs = vec![
            ShaderDefVal::UInt("CELL_WIDTH".into(), width),
            ShaderDefVal::UInt("CELL_HEIGHT".into(), height),
        ];
        if key.fraction == GiPixelFraction::Full {
            shader_defs.push("FULL_RESOLUTION".into());
        }
        if key.shading == GiShading::Lambertian {
            shader_defs.push("LAMBERTIAN".into());
        }
        let add = BlendComponent {
            src_factor: BlendFactor::One,
            dst_factor: BlendFactor::One,
            operation: BlendOperation::Add,
        };
        let keep = BlendComponent {
            src_factor: BlendFactor::Zero,
            dst_factor: BlendFactor::One,
            operation: BlendOperation::Add,
        };
        RenderPipelineDescriptor {
            label: Some("bevy_frugal_gi/composite".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs,
                entry_point: Some("composite".into()),
                targets: vec![Some(ColorTargetState {
                    format: key.target_format,
                    blend: Some(BlendState { color: add, alpha: keep }),
                    write_mask: ColorWrites::ALL,
                })],
            }),
            ..default()
        }
    }
}

/// The pipeline of one camera.
#[derive(Component)]
pub(super) struct CompositePipelineId(CachedRenderPipelineId);

fn prepare_pipelines(
    mut commands: Commands,
    mut specialized: ResMut<SpecializedRenderPipelines<CompositePipelines>>,
    pipelines: Res<CompositePipelines>,
    cache: Res<PipelineCache>,
    cameras: Query<(Entity, &FrugalGi, &ExtractedView)>,
) {
    for (entity, gi, view) in &cameras {
        let key = CompositeKey {
            fraction: gi.pixel_fraction,
            shading: gi.shading,
            target_format: view.target_format,
        };
        let pipeline = specialized.specialize(&cache, &pipelines, key);
        commands.entity(entity).insert(CompositePipelineId(pipeline));
    }
}

/// In a GI camera's view, after opaque meshes.
pub(super) fn composite(
    view: ViewQuery<(
        &FrugalGi,
        &ExtractedCamera,
        &ViewTarget,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        &CompositePipelineId,
        Option<(&GiView, &GatherView)>,
    )>,
    pipelines: Res<CompositePipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (gi, camera, target, prepass, view_offset, pipeline, gathered) = view.into_inner();
    let alone = gi.output == GiOutput::IndirectOnly;
    let bind_group = (|| {
        let (_, gather) = gathered?;
        let entries = BindGroupEntries::sequential((
            prepass.deferred_view()?,
            prepass.depth_view()?,
            view_uniforms.uniforms.binding()?,
            &gather.irradiance.default_view,
        ));
        let layout = cache.get_bind_group_layout(&pipelines.layout);
        Some(context.render_device().create_bind_group(
            "bevy_frugal_gi/composite",
            &layout,
            &entries,
        ))
    })();
    let drawn = bind_group.zip(cache.get_render_pipeline(pipeline.0));
    if drawn.is_none() && !alone {
        return;
    }
    // The fraction may have changed while its pipeline compiles: low-resolution pixels of another
    // size would be misread.
    let drawn = drawn
        .filter(|_| gathered.is_some_and(|(view, _)| view.gi.pixel_fraction == gi.pixel_fraction));

    let mut attachment = target.get_color_attachment();
    if alone {
        attachment.ops.load = LoadOp::Clear(default());
    }
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/composite");
    {
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bevy_frugal_gi/composite"),
            color_attachments: &[Some(attachment)],
            depth_stencil_attachment: None,
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        if let Some((bind_group, pipeline)) = &drawn {
            if let Some(viewport) = &camera.viewport {
                pass.set_camera_viewport(viewport);
            }
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[view_offset.offset]);
            pass.draw(0..3, 0..1);
        }
    }
    span.end(context.command_encoder());
}

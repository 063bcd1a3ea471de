//! The composite's pipelines and bind group layouts, specialised for each camera.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::FullscreenShader;
use bevy::pbr::{GpuFog, ScreenSpaceAmbientOcclusion};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::binding_types::{texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::view::{ExtractedView, ViewUniform};
use bevy::shader::ShaderDefVal;

use crate::gi::compute::definitions;
use crate::gi::settings::{FrugalGi, GiOutput, GiPixelFraction, GiShading};

#[derive(Resource)]
pub(in crate::gi) struct CompositePipelines {
    shader: Handle<Shader>,
    vertex: VertexState,
}

impl FromWorld for CompositePipelines {
    fn from_world(world: &mut World) -> Self {
        world.init_resource::<SpecializedRenderPipelines<CompositePipelines>>();
        let vertex = world.resource::<FullscreenShader>().to_vertex_state();
        Self { vertex, shader: load_embedded_asset!(world, "composite.wgsl") }
    }
}

/// Key of a composite pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::gi) struct CompositeKey {
    fraction: GiPixelFraction,
    shading: GiShading,
    target_format: TextureFormat,
    /// Replaces what was drawn before, instead of adding to it.
    replaces: bool,
    /// Dimmed by the camera's distance fog.
    pub fog: bool,
    /// Dimmed by the screen's ambient occlusion.
    pub occlusion: bool,
}

impl CompositeKey {
    /// Entries: G-buffer, depth, view and irradiance; then the fog and the occlusion, if any.
    pub(crate) fn layout(&self) -> BindGroupLayoutDescriptor {
        let mut entries = DynamicBindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer::<ViewUniform>(true),
                texture_2d(TextureSampleType::Float { filterable: false }),
            ),
        );
        if self.fog {
            entries = entries.extend_with_indices(((4, uniform_buffer::<GpuFog>(true)),));
        }
        if self.occlusion {
            let occlusion = texture_2d(TextureSampleType::Float { filterable: false });
            entries = entries.extend_with_indices(((5, occlusion),));
        }
        BindGroupLayoutDescriptor::new("frugal_gi/composite", &entries)
    }
}

impl SpecializedRenderPipeline for CompositePipelines {
    type Key = CompositeKey;

    fn specialize(&self, key: CompositeKey) -> RenderPipelineDescriptor {
        let (width, height) = key.fraction.cell();
        let mut shader_defs = definitions([
            (key.fraction == GiPixelFraction::Full, "FULL_RESOLUTION"),
            (key.shading == GiShading::Lambertian, "LAMBERTIAN"),
            (key.fog, "DISTANCE_FOG"),
            (key.occlusion, "SCREEN_OCCLUSION"),
        ]);
        shader_defs.push(ShaderDefVal::UInt("CELL_WIDTH".into(), width));
        shader_defs.push(ShaderDefVal::UInt("CELL_HEIGHT".into(), height));
        let blended = |src_factor, dst_factor| BlendComponent {
            src_factor,
            dst_factor,
            operation: BlendOperation::Add,
        };
        let (own, before) = match key.replaces {
            true => (BlendFactor::One, BlendFactor::Zero),
            false => (BlendFactor::Zero, BlendFactor::One),
        };
        // The constant is the share of indirect light that the camera shows.
        let (color, alpha) = (blended(BlendFactor::Constant, before), blended(own, before));
        RenderPipelineDescriptor {
            label: Some("frugal_gi/composite".into()),
            layout: vec![key.layout()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs,
                entry_point: Some("composite".into()),
                targets: vec![Some(ColorTargetState {
                    format: key.target_format,
                    blend: Some(BlendState { color, alpha }),
                    write_mask: ColorWrites::ALL,
                })],
            }),
            ..default()
        }
    }
}

/// The pipeline of one camera.
#[derive(Component)]
pub(in crate::gi) struct CompositePipeline {
    pub id: CachedRenderPipelineId,
    pub key: CompositeKey,
}

pub(super) fn prepare(
    mut commands: Commands,
    mut specialized: ResMut<SpecializedRenderPipelines<CompositePipelines>>,
    pipelines: Res<CompositePipelines>,
    cache: Res<PipelineCache>,
    cameras: Query<(
        Entity,
        &FrugalGi,
        &ExtractedCamera,
        &ExtractedView,
        Has<DistanceFog>,
        Has<ScreenSpaceAmbientOcclusion>,
    )>,
) {
    for (entity, gi, camera, view, has_fog, has_occlusion) in &cameras {
        let key = CompositeKey {
            fraction: gi.pixel_fraction,
            shading: gi.shading,
            target_format: view.target_format,
            replaces: gi.output == GiOutput::IndirectOnly,
            fog: has_fog,
            // Rays already found what occludes: it would be removed twice. And Bevy 0.19.1 reads
            // the depth of a viewport from the target's corner.
            occlusion: has_occlusion
                && gi.visibility.rays() == 0
                && camera.viewport.as_ref().is_none_or(|v| v.physical_position == default()),
        };
        let id = specialized.specialize(&cache, &pipelines, key);
        commands.entity(entity).insert(CompositePipeline { id, key });
    }
}

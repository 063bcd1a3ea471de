//! The draws: one per light, all added to the image.

use std::collections::BTreeMap;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::math::{Mat4, Vec3};
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, uniform_buffer,
    uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, ViewTarget, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;
use bevy_frugal_gi::gi::inspect::{self, GiMapState};

use super::{NaiveRsm, pattern};
use crate::gpu;

#[derive(Resource)]
pub(super) struct NaivePipelines {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    vertex: VertexState,
}

impl FromWorld for NaivePipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "frugal_tests/naive_rsm",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    storage_buffer_read_only_sized(false, None),
                    uniform_buffer_sized(false, None),
                    uniform_buffer::<MapUniform>(false),
                ),
            ),
        );
        world.init_resource::<SpecializedRenderPipelines<NaivePipelines>>();
        let vertex = world.resource::<FullscreenShader>().to_vertex_state();
        Self { layout, vertex, shader: load_embedded_asset!(world, "naive.wgsl") }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct NaiveKey {
    samples: u32,
    is_cube: bool,
    target_format: TextureFormat,
}

impl SpecializedRenderPipeline for NaivePipelines {
    type Key = NaiveKey;

    fn specialize(&self, key: NaiveKey) -> RenderPipelineDescriptor {
        let mut shader_defs =
            vec![ShaderDefVal::UInt("SAMPLES".into(), key.samples), "LAMBERTIAN".into()];
        if key.is_cube {
            shader_defs.push("CUBE".into());
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
            label: Some("frugal_tests/naive_rsm".into()),
            layout: vec![self.layout.clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs,
                entry_point: Some("naive_rsm".into()),
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

/// The pipelines of one camera.
#[derive(Component)]
pub(super) struct NaivePipelineIds {
    flat: CachedRenderPipelineId,
    cube: CachedRenderPipelineId,
}

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    mut specialized: ResMut<SpecializedRenderPipelines<NaivePipelines>>,
    pipelines: Res<NaivePipelines>,
    cache: Res<PipelineCache>,
    cameras: Query<(Entity, &NaiveRsm, &ExtractedView)>,
) {
    for (entity, naive, view) in &cameras {
        let mut of = |is_cube| {
            let key =
                NaiveKey { samples: naive.samples, is_cube, target_format: view.target_format };
            specialized.specialize(&cache, &pipelines, key)
        };
        let ids = NaivePipelineIds { flat: of(false), cube: of(true) };
        commands.entity(entity).insert(ids);
    }
}

/// `naive.wgsl`'s `Face`.
#[derive(ShaderType, Clone, Copy, Default)]
struct FaceUniform {
    clip_from_world: Mat4,
    texel_offset: u32,
}

/// `naive.wgsl`'s `Map`.
#[derive(ShaderType, Clone, Copy, Default)]
struct MapUniform {
    faces: [FaceUniform; 6],
    light_position: Vec3,
    side: f32,
    largest_geometry_term: f32,
}

/// Bindings of one light's draw.
struct LightDraw {
    is_cube: bool,
    map: UniformBuffer<MapUniform>,
}

/// Bindings of one camera's draws.
#[derive(Component)]
pub(super) struct NaiveLights {
    texels: Buffer,
    flat_pattern: Buffer,
    spherical_pattern: Buffer,
    lights: Vec<LightDraw>,
}

/// The plugin's maps and the buffer of their texels.
#[derive(Resource, Default)]
pub(super) struct KnownMaps {
    texels: Option<Buffer>,
    maps: Vec<GiMapState>,
}

/// The plugin reports no maps in frames without rendering any; the known ones remain valid.
pub(super) fn learn_maps(world: &World, mut commands: Commands) {
    let state = inspect::gpu_state(world);
    commands.queue(move |world: &mut World| {
        let mut known = world.resource_mut::<KnownMaps>();
        known.texels = state.texels;
        if !state.maps.is_empty() {
            known.maps = state.maps;
        }
    });
}

/// Creates the buffers in each frame: a few kilobytes, whose cost is negligible next to the draws.
pub(super) fn prepare_lights(
    mut commands: Commands,
    known: Res<KnownMaps>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cameras: Query<(Entity, &MainEntity, &NaiveRsm)>,
) {
    for (entity, camera, naive) in &cameras {
        let Some(texels) = known.texels.clone() else {
            commands.entity(entity).remove::<NaiveLights>();
            continue;
        };
        let mut lights: BTreeMap<Entity, Vec<GiMapState>> = BTreeMap::new();
        for map in
            known.maps.iter().filter(|map| map.view.camera.is_none_or(|owner| owner == camera.id()))
        {
            lights.entry(map.view.light).or_default().push(*map);
        }
        let pattern = |samples: Vec<[f32; 4]>| {
            let contents = gpu::bytes(samples.as_flattened());
            let label = Some("frugal_tests/naive_rsm/pattern");
            device.create_buffer_with_data(&BufferInitDescriptor {
                label,
                contents: &contents,
                usage: BufferUsages::UNIFORM,
            })
        };
        let radius = f64::from(naive.radius);
        commands.entity(entity).insert(NaiveLights {
            texels,
            flat_pattern: pattern(pattern::flat(naive.samples, radius, naive.weights)),
            spherical_pattern: pattern(pattern::spherical(naive.samples, radius, naive.weights)),
            lights: lights
                .into_values()
                .map(|maps| light_draw(&maps, naive, &device, &queue))
                .collect(),
        });
    }
}

fn light_draw(
    maps: &[GiMapState],
    naive: &NaiveRsm,
    device: &RenderDevice,
    queue: &RenderQueue,
) -> LightDraw {
    let is_cube = maps.len() > 1;
    let mut map = MapUniform {
        light_position: maps[0].light_position,
        side: maps[0].resolution as f32,
        largest_geometry_term: (naive.clamp_distance * naive.clamp_distance).recip().min(1e30),
        ..default()
    };
    let face_of = |map: &GiMapState| FaceUniform {
        clip_from_world: map.clip_from_world,
        texel_offset: map.texel_offset,
    };
    if is_cube {
        let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
        for (face, axis) in map.faces.iter_mut().zip(axes) {
            // A point on the axis is in front of exactly one face.
            let depth = |map: &GiMapState| {
                (map.clip_from_world * (map.light_position + axis).extend(1.0)).w
            };
            if let Some(found) = maps.iter().max_by(|a, b| depth(a).total_cmp(&depth(b))) {
                *face = face_of(found);
            }
        }
    } else {
        map.faces[0] = face_of(&maps[0]);
    }
    let mut map = UniformBuffer::from(map);
    map.write_buffer(device, queue);
    LightDraw { is_cube, map }
}

/// Draws in the view of a camera with the baseline, in place of the plugin's composite.
pub(super) fn draw(
    view: ViewQuery<(
        &NaiveRsm,
        &ExtractedCamera,
        &ViewTarget,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        &NaivePipelineIds,
        Option<&NaiveLights>,
    )>,
    pipelines: Res<NaivePipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (naive, camera, target, prepass, view_offset, ids, lights) = view.into_inner();
    let layout = cache.get_bind_group_layout(&pipelines.layout);
    let device = context.render_device().clone();
    let bind = |lights: &NaiveLights, light: &LightDraw| {
        let pattern = if light.is_cube { &lights.spherical_pattern } else { &lights.flat_pattern };
        let entries = BindGroupEntries::sequential((
            prepass.deferred_view()?,
            prepass.depth_view()?,
            view_uniforms.uniforms.binding()?,
            lights.texels.as_entire_binding(),
            pattern.as_entire_binding(),
            light.map.binding()?,
        ));
        let pipeline =
            cache.get_render_pipeline(if light.is_cube { ids.cube } else { ids.flat })?;
        Some((pipeline, device.create_bind_group("frugal_tests/naive_rsm", &layout, &entries)))
    };
    let draws: Vec<_> = lights
        .iter()
        .flat_map(|lights| lights.lights.iter().filter_map(|light| bind(lights, light)))
        .collect();
    let mut attachment = target.get_color_attachment();
    if naive.alone {
        attachment.ops.load = LoadOp::Clear(default());
    }
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("frugal_tests/naive_rsm"),
        color_attachments: &[Some(attachment)],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    for (pipeline, bind_group) in &draws {
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, bind_group, &[view_offset.offset]);
        pass.draw(0..3, 0..1);
    }
}

//! The sky as a source: a camera's environment map, drawn in proportion to what its surfaces could
//! receive, and hidden by what stands in the way.
//!
//! | pass | when | job |
//! |---|---|---|
//! | `sky_fill.wgsl` | when the map changes | the map as parts of equal solid angle |
//! | `sky_weigh.wgsl` | when VPLs are drawn | what some points of the picture could receive of each part, by rays |
//! | `sky_draw.wgsl` | when VPLs are drawn | samples: directions that stand for the whole sky |
//! | `gather/gather.wgsl` | when the camera gathers | what each pixel receives of its samples |
//!
//! Samples of the sky lie beside the VPLs of bounced light and not among them: the sky is
//! everywhere as far away, so that it is drawn by direction; and from indoors most of it is hidden,
//! where a ray for sky and bounce together would find neither.

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::asset::{AssetId, Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight};
use bevy::math::Quat;
use bevy::render::Extract;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_2d_array,
    texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::Shader;
use bevy::utils::default;
use bytemuck::{Pod, Zeroable};

use crate::gi::gather::{GatherKind, GatherPipelines, GiCamera};
use crate::gi::settings::FrugalGi;
use crate::gi::visibility::OccluderBuffers;

/// Bytes of `sources/sky.wgsl`'s `SkyLight`. A test holds it against the shader.
pub(in crate::gi) const SKY_LIGHT_BYTES: u64 = 32;
/// Parts of the sky, as `sources/sky.wgsl` has them.
const PARTS: u32 = 1024;
/// Parts that a workgroup of `sky_weigh.wgsl` answers for.
const PARTS_PER_GROUP: u32 = 4;
/// Steps along each side of a part in which `sky_fill.wgsl` reads the map.
const STEPS: u32 = 16;
/// Bytes from one set of samples to the next: most samples of a pixel, and a multiple of what
/// uniform offsets are multiples of.
pub(in crate::gi) const SET_BYTES: u64 = FrugalGi::MAX_ENVIRONMENT_SAMPLES as u64 * SKY_LIGHT_BYTES;

/// A GI camera's environment map, as its app set it.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct SkySource {
    pub(super) diffuse: AssetId<Image>,
    pub(super) specular: AssetId<Image>,
    /// Nits that the map's 1 stands for.
    intensity: f32,
    rotation: Quat,
    /// The renderer makes the map anew in each frame.
    is_generated: bool,
}

/// `sources/sky.wgsl`'s `SkyPlan`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct SkyPlan {
    pub samples: u32,
    pub sets: u32,
}

/// `sources/sky_fill.wgsl`'s `SkySource`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct SkyReading {
    rotation: [f32; 4],
    intensity: f32,
    level: u32,
    padding: [f32; 2],
}

/// What decides about the light that a camera's pixels get from the sky, beside where the camera
/// is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct SkySeen {
    plan: SkyPlan,
    reading: (TextureId, SkyReading),
    is_generated: bool,
}

impl SkySeen {
    /// Samples that a pixel evaluates.
    pub fn samples(&self) -> u32 {
        self.plan.samples
    }

    /// Whether the map is made anew in each frame.
    pub fn is_generated(&self) -> bool {
        self.is_generated
    }
}

/// What a GI camera holds in the render world for its sky.
#[derive(Component)]
pub struct SkyCamera {
    pub(in crate::gi) plan: SkyPlan,
    pub(in crate::gi) plan_buffer: Buffer,
    /// `SkyLight` each, in sets [`SET_BYTES`] apart.
    pub(in crate::gi) samples: Buffer,
    parts: Buffer,
    received: Buffer,
    reading_buffer: Buffer,
    /// What the parts were read from.
    reading: (TextureId, SkyReading),
    is_filled: AtomicBool,
    is_generated: bool,
    /// Whether all pipelines are there: until then Bevy's own light stays.
    pub(in crate::gi) is_active: bool,
}

impl SkyCamera {
    /// What decides about light from the sky, while it is gathered.
    pub(in crate::gi) fn seen(&self) -> Option<SkySeen> {
        self.is_active.then_some(SkySeen {
            plan: self.plan,
            reading: self.reading,
            is_generated: self.is_generated,
        })
    }

    /// Bytes held on the GPU for this camera's sky.
    pub fn bytes(&self) -> u64 {
        [&self.plan_buffer, &self.samples, &self.parts, &self.received, &self.reading_buffer]
            .map(|buffer| buffer.size())
            .iter()
            .sum()
    }
}

/// The passes' layouts; their pipelines are there once a camera has had a sky.
#[derive(Resource)]
pub(in crate::gi) struct SkyPipelines {
    layouts: [BindGroupLayoutDescriptor; 3],
    shaders: [Handle<Shader>; 3],
    pipelines: Option<[CachedComputePipelineId; 3]>,
}

impl FromWorld for SkyPipelines {
    fn from_world(world: &mut World) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let write = || storage_buffer_sized(false, None);
        let faces = texture_2d_array(TextureSampleType::Float { filterable: false });
        let compute = ShaderStages::COMPUTE;
        let fill = BindGroupLayoutEntries::sequential(compute, (faces, read(), write()));
        let weigh = BindGroupLayoutEntries::sequential(
            compute,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer::<ViewUniform>(true),
                read(),
                write(),
            ),
        );
        let draw = BindGroupLayoutEntries::sequential(compute, (read(), read(), read(), write()));
        Self {
            layouts: [
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/fill", &fill),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/weigh", &weigh),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/draw", &draw),
            ],
            shaders: [
                load_embedded_asset!(world, "sky_fill.wgsl"),
                load_embedded_asset!(world, "sky_weigh.wgsl"),
                load_embedded_asset!(world, "sky_draw.wgsl"),
            ],
            pipelines: None,
        }
    }
}

impl SkyPipelines {
    /// Has the pipelines compiled, where that was not asked for before.
    fn demand(&mut self, cache: &PipelineCache) -> [CachedComputePipelineId; 3] {
        let Self { layouts, shaders, pipelines } = self;
        *pipelines.get_or_insert_with(|| {
            let names = ["fill_sky", "weigh_sky", "draw_sky"];
            std::array::from_fn(|index| {
                let mut layout = vec![layouts[index].clone()];
                if names[index] == "weigh_sky" {
                    layout.push(OccluderBuffers::layout());
                }
                cache.queue_compute_pipeline(ComputePipelineDescriptor {
                    label: Some(format!("bevy_frugal_gi/sky/{}", names[index]).into()),
                    layout,
                    shader: shaders[index].clone(),
                    entry_point: Some(names[index].into()),
                    ..default()
                })
            })
        })
    }
}

/// Takes GI cameras' environment maps over into the render world.
pub(in crate::gi) fn extract_sources(
    mut commands: Commands,
    cameras: Extract<
        Query<
            (RenderEntity, Option<&EnvironmentMapLight>, Has<GeneratedEnvironmentMapLight>),
            With<FrugalGi>,
        >,
    >,
) {
    for (entity, environment, is_generated) in &cameras {
        let Ok(mut entity) = commands.get_entity(entity) else { continue };
        match environment {
            Some(environment) => entity.insert(SkySource {
                diffuse: environment.diffuse_map.id(),
                specular: environment.specular_map.id(),
                intensity: environment.intensity,
                rotation: environment.rotation,
                is_generated,
            }),
            None => entity.remove::<SkySource>(),
        };
    }
}

/// Gives every GI camera that traces rays to an environment map its buffers, and takes them from
/// the others.
pub(in crate::gi) fn prepare_cameras(
    mut commands: Commands,
    mut pipelines: ResMut<SkyPipelines>,
    mut gather: ResMut<GatherPipelines>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    cameras: Query<(Entity, &FrugalGi, &SkySource), With<ExtractedCamera>>,
    mut held: Query<&mut SkyCamera>,
    stale: Query<
        Entity,
        (With<SkyCamera>, Or<(Without<FrugalGi>, Without<SkySource>, Without<ExtractedCamera>)>),
    >,
) {
    for entity in &stale {
        commands.entity(entity).remove::<SkyCamera>();
    }
    for (entity, gi, source) in &cameras {
        let samples = gi.environment_samples.min(FrugalGi::MAX_ENVIRONMENT_SAMPLES);
        let is_lit =
            source.intensity > 0.0 && source.intensity.is_finite() && source.rotation.is_finite();
        let image = images.get(source.specular).filter(|_| {
            samples > 0 && gi.traces() && is_lit && images.get(source.diffuse).is_some()
        });
        let Some(image) = image else {
            if held.contains(entity) {
                commands.entity(entity).remove::<SkyCamera>();
            }
            continue;
        };
        let is_active = {
            let mut needed = pipelines.demand(&cache).to_vec();
            needed.push(gather.demand(
                &cache,
                GatherKind { visibility: gi.visibility, has_sky: true, has_masks: false },
            ));
            needed.into_iter().all(|pipeline| cache.get_compute_pipeline(pipeline).is_some())
        };
        let plan = SkyPlan { samples, sets: gi.interleave.side().pow(2) };
        let reading = (image.texture.id(), reading(source, image));
        if let Ok(mut held) = held.get_mut(entity)
            && held.plan == plan
        {
            held.is_active = is_active;
            if held.reading != reading {
                queue.write_buffer(&held.reading_buffer, 0, bytemuck::bytes_of(&reading.1));
                held.reading = reading;
                held.is_filled.store(false, Ordering::Relaxed);
            }
            held.is_generated = source.is_generated;
            if source.is_generated {
                held.is_filled.store(false, Ordering::Relaxed);
            }
            continue;
        }
        let empty = |label, size, usage| {
            let usage = BufferUsages::STORAGE | usage;
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let filled = |label, contents: &[u8]| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        commands.entity(entity).insert(SkyCamera {
            plan,
            plan_buffer: filled("bevy_frugal_gi/sky/plan", bytemuck::bytes_of(&plan)),
            samples: empty(
                "bevy_frugal_gi/sky/samples",
                u64::from(plan.sets) * SET_BYTES,
                BufferUsages::UNIFORM | BufferUsages::COPY_SRC,
            ),
            parts: empty(
                "bevy_frugal_gi/sky/parts",
                u64::from(PARTS) * SKY_LIGHT_BYTES,
                BufferUsages::COPY_SRC,
            ),
            received: empty(
                "bevy_frugal_gi/sky/received",
                u64::from(PARTS) * 4,
                BufferUsages::COPY_SRC,
            ),
            reading_buffer: filled("bevy_frugal_gi/sky/reading", bytemuck::bytes_of(&reading.1)),
            reading,
            is_filled: AtomicBool::new(false),
            is_generated: source.is_generated,
            is_active,
        });
    }
}

fn reading(source: &SkySource, image: &GpuImage) -> SkyReading {
    // Texels of the level that is read are as large as the steps: 6 edge² of them cover the sphere,
    // and so do PARTS · STEPS² steps.
    let edge = (PARTS as f32 / 6.0).sqrt() * STEPS as f32;
    let level = (image.texture_descriptor.size.width as f32 / edge).log2().max(0.0) as u32;
    // Bevy turns the map by the rotation, and so directions into the map by its inverse.
    SkyReading {
        rotation: source.rotation.inverse().to_array(),
        intensity: source.intensity,
        level,
        padding: [0.0; 2],
    }
}

/// In a GI camera's view: reads the sky where it changed, and weighs it and draws its samples then
/// and when VPLs are drawn.
pub(in crate::gi) fn sample(
    view: ViewQuery<(&SkyCamera, &SkySource, &GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<SkyPipelines>,
    occluders: Res<OccluderBuffers>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, source, gi_camera, prepass, view_offset) = view.into_inner();
    if !gi_camera.work.draw && camera.is_filled.load(Ordering::Relaxed) {
        return;
    }
    let Some([Some(fill), Some(weigh), Some(draw)]) =
        pipelines.pipelines.map(|ids| ids.map(|id| cache.get_compute_pipeline(id)))
    else {
        return;
    };
    let (Some(g_buffer), Some(depth), Some(views)) =
        (prepass.deferred_view(), prepass.depth_view(), view_uniforms.uniforms.binding())
    else {
        return;
    };
    let (Some(image), Some(traced), true) =
        (images.get(source.specular), occluders.bind_group(), camera.is_active)
    else {
        return;
    };
    let device = context.render_device();
    let [fill_layout, weigh_layout, draw_layout] =
        pipelines.layouts.each_ref().map(|layout| cache.get_bind_group_layout(layout));
    let faces = image.texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    });
    let filling = device.create_bind_group(
        "bevy_frugal_gi/sky/fill",
        &fill_layout,
        &BindGroupEntries::sequential((
            &faces,
            camera.reading_buffer.as_entire_binding(),
            camera.parts.as_entire_binding(),
        )),
    );
    let weighing = device.create_bind_group(
        "bevy_frugal_gi/sky/weigh",
        &weigh_layout,
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views,
            camera.parts.as_entire_binding(),
            camera.received.as_entire_binding(),
        )),
    );
    let drawing = device.create_bind_group(
        "bevy_frugal_gi/sky/draw",
        &draw_layout,
        &BindGroupEntries::sequential((
            camera.parts.as_entire_binding(),
            camera.received.as_entire_binding(),
            camera.plan_buffer.as_entire_binding(),
            camera.samples.as_entire_binding(),
        )),
    );
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/sky");
    {
        let mut pass = context.command_encoder().begin_compute_pass(&ComputePassDescriptor {
            label: Some("bevy_frugal_gi/sky"),
            timestamp_writes: None,
        });
        if !camera.is_filled.swap(true, Ordering::Relaxed) {
            pass.set_bind_group(0, &filling, &[]);
            pass.set_pipeline(fill);
            pass.dispatch_workgroups(PARTS / 64, 1, 1);
        }
        pass.set_bind_group(0, &weighing, &[view_offset.offset]);
        pass.set_bind_group(1, traced, &[]);
        pass.set_pipeline(weigh);
        pass.dispatch_workgroups(PARTS / PARTS_PER_GROUP, 1, 1);
        pass.set_bind_group(0, &drawing, &[]);
        pass.set_pipeline(draw);
        pass.dispatch_workgroups(1, 1, 1);
    }
    span.end(context.command_encoder());
}

//! A GI camera's buffers for its sky, and the pipelines.

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_2d_array, texture_depth_2d, texture_storage_2d_array, uniform_buffer,
    uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy::render::view::ViewUniform;
use bytemuck::{Pod, Zeroable};

use crate::gi::compute::{Kernel, bytes_of, empty_buffer, filled_buffer, read, write};
use crate::gi::settings::FrugalGi;
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::SkySource;

/// Bytes of `sky/sky.wgsl`'s `SkyLight`. A test compares it with the shader.
pub(in crate::gi) const SKY_LIGHT_BYTES: u64 = 32;
/// Strata of the sky.
pub(in crate::gi) const STRATA: u32 = 1024;
/// Strata of a workgroup of `weigh.wgsl`.
pub(in crate::gi) const STRATA_PER_GROUP: u32 = 4;
/// Steps along each side of a stratum in which `fill.wgsl` reads the map.
pub(in crate::gi) const STEPS: u32 = 16;
/// Bytes from one set of samples to the next: room for the most samples of a pixel.
const SET_BYTES: u64 = FrugalGi::MAX_ENVIRONMENT_SAMPLES as u64 * SKY_LIGHT_BYTES;

/// `sky/fill.wgsl`'s `SkySource`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct SkyReading {
    rotation: [f32; 4],
    intensity: f32,
    level: u32,
    padding: [f32; 2],
}

/// What a camera's sky light depends on, apart from the camera's pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct SkyInputs {
    /// Samples in each set.
    pub samples: u32,
    sets: u32,
    /// The source of the strata.
    reading: (TextureId, SkyReading),
    is_generated: bool,
}

impl SkyInputs {
    /// Whether the map is generated in each frame.
    pub(crate) fn is_generated(&self) -> bool {
        self.is_generated
    }
}

/// A GI camera's buffers for its sky. In the render world.
#[derive(Component)]
pub(crate) struct SkyCamera {
    inputs: SkyInputs,
    /// An array of `SkyLight`, in sets [`SET_BYTES`] apart.
    pub(in crate::gi) samples: Buffer,
    pub(super) strata: Buffer,
    pub(super) importance: Buffer,
    pub(super) reading_buffer: Buffer,
    pub(super) is_filled: AtomicBool,
    /// Whether all pipelines are compiled: until then Bevy's own light stays.
    pub(in crate::gi) is_active: bool,
}

impl SkyCamera {
    /// The inputs of the sky light, while it is gathered.
    pub(in crate::gi) fn inputs(&self) -> Option<SkyInputs> {
        self.is_active.then_some(self.inputs)
    }

    /// Bytes held on the GPU for this camera's sky.
    pub(crate) fn bytes(&self) -> u64 {
        let Self { samples, strata, importance, reading_buffer, .. } = self;
        bytes_of([samples, strata, importance, reading_buffer])
    }

    fn new(device: &RenderDevice, inputs: SkyInputs, is_active: bool) -> Self {
        let storage = BufferUsages::STORAGE;
        let empty =
            |label, size| empty_buffer(device, label, size, storage | BufferUsages::COPY_SRC);
        let (sets, strata) = (u64::from(inputs.sets), u64::from(STRATA));
        Self {
            inputs,
            samples: empty("frugal_gi/sky/samples", sets * SET_BYTES),
            strata: empty("frugal_gi/sky/strata", strata * SKY_LIGHT_BYTES),
            importance: empty("frugal_gi/sky/importance", strata * 4),
            reading_buffer: filled_buffer(
                device,
                "frugal_gi/sky/reading",
                bytemuck::bytes_of(&inputs.reading.1),
                storage,
            ),
            is_filled: AtomicBool::new(false),
            is_active,
        }
    }
}

/// Gives every GI camera that traces rays to an environment map its buffers, and removes those of
/// others.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    mut kernels: ResMut<SkyKernels>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    mut cameras: Query<
        (Entity, Option<(&FrugalGi, &SkySource, &ExtractedCamera)>, Option<&mut SkyCamera>),
        Or<(With<FrugalGi>, With<SkyCamera>)>,
    >,
) {
    for (entity, camera, held) in &mut cameras {
        let lit = camera.and_then(|(gi, source, _)| {
            let samples = gi.environment_samples.min(FrugalGi::MAX_ENVIRONMENT_SAMPLES);
            let is_lit = source.intensity > 0.0
                && source.intensity.is_finite()
                && source.rotation.is_finite();
            let is_needed = samples > 0 && gi.traces() && is_lit;
            images.get(source.diffuse).filter(|_| is_needed)?;
            let image = images.get(source.specular)?;
            Some(SkyInputs {
                samples,
                sets: gi.interleave.side().pow(2),
                reading: (image.texture.id(), reading(source, image)),
                is_generated: source.is_generated,
            })
        });
        let Some(inputs) = lit else {
            if held.is_some() {
                commands.entity(entity).remove::<SkyCamera>();
            }
            continue;
        };
        let is_active = kernels.are_ready(&cache);
        let count = |inputs: &SkyInputs| (inputs.samples, inputs.sets);
        let Some(mut held) = held.filter(|held| count(&held.inputs) == count(&inputs)) else {
            commands.entity(entity).insert(SkyCamera::new(&device, inputs, is_active));
            continue;
        };
        held.is_active = is_active;
        if held.inputs.reading != inputs.reading {
            queue.write_buffer(&held.reading_buffer, 0, bytemuck::bytes_of(&inputs.reading.1));
        }
        if held.inputs.reading != inputs.reading || inputs.is_generated {
            held.is_filled.store(false, Ordering::Relaxed);
        }
        held.inputs = inputs;
    }
}

fn reading(source: &SkySource, image: &GpuImage) -> SkyReading {
    // Texels of the mip level are as large as the steps: 6 edge² of them cover the sphere, and so
    // do STRATA · STEPS² steps.
    let edge = (STRATA as f32 / 6.0).sqrt() * STEPS as f32;
    let level = (image.texture_descriptor.size.width as f32 / edge).log2().max(0.0) as u32;
    // Bevy rotates the map; directions into the map rotate by the inverse.
    SkyReading {
        rotation: source.rotation.inverse().to_array(),
        intensity: source.intensity,
        level,
        padding: [0.0; 2],
    }
}

/// The pipelines of a sky. They are queued once a camera has a sky.
#[derive(Resource)]
pub(in crate::gi) struct SkyKernels {
    pub(super) fill: Kernel,
    pub(super) weigh: Kernel,
    pub(super) sample: Kernel,
    pub(super) dim: Kernel,
}

impl FromWorld for SkyKernels {
    fn from_world(world: &mut World) -> Self {
        let faces = texture_2d_array(TextureSampleType::Float { filterable: false });
        let compute = ShaderStages::COMPUTE;
        let filling = BindGroupLayoutEntries::sequential(compute, (faces, read(), write()));
        let (g_buffer, depth) = (texture_2d(TextureSampleType::Uint), texture_depth_2d());
        let view = uniform_buffer::<ViewUniform>(true);
        let weighing =
            BindGroupLayoutEntries::sequential(compute, (g_buffer, depth, view, read(), write()));
        let sampling =
            BindGroupLayoutEntries::sequential(compute, (read(), read(), read(), write()));
        let target =
            texture_storage_2d_array(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        let dimming = BindGroupLayoutEntries::sequential(
            compute,
            (faces, uniform_buffer_sized(false, None), target),
        );
        let [fill, weigh, sample, dim] = [
            load_embedded_asset!(world, "fill.wgsl"),
            load_embedded_asset!(world, "weigh.wgsl"),
            load_embedded_asset!(world, "sample.wgsl"),
            load_embedded_asset!(world, "dim.wgsl"),
        ];
        Self {
            fill: Kernel::new("frugal_gi/sky/fill", "fill_sky", &fill, &filling),
            weigh: Kernel::new("frugal_gi/sky/weigh", "weigh_sky", &weigh, &weighing)
                .with_group(OccluderBuffers::layout()),
            sample: Kernel::new("frugal_gi/sky/sample", "sample_sky", &sample, &sampling),
            dim: Kernel::new("frugal_gi/sky/dim", "dim_sky", &dim, &dimming),
        }
    }
}

impl SkyKernels {
    /// Whether the pipelines are compiled. Queues them if they are not.
    fn are_ready(&mut self, cache: &PipelineCache) -> bool {
        [&mut self.fill, &mut self.weigh, &mut self.sample, &mut self.dim].map(|kernel| {
            kernel.queue(cache, Vec::new());
            kernel.get(cache, &[]).is_some()
        }) == [true; 4]
    }
}

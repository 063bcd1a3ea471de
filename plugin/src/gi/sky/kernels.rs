//! The pipelines of a sky.

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_2d_array, texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::view::ViewUniform;

use crate::gi::compute::{Kernel, read, write};
use crate::gi::trace::OccluderBuffers;

/// Pipelines are queued once a camera has a sky.
#[derive(Resource)]
pub(in crate::gi) struct SkyKernels {
    pub(super) fill: Kernel,
    pub(super) weigh: Kernel,
    pub(super) sample: Kernel,
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
        let [fill, weigh, sample] = [
            load_embedded_asset!(world, "fill.wgsl"),
            load_embedded_asset!(world, "weigh.wgsl"),
            load_embedded_asset!(world, "sample.wgsl"),
        ];
        Self {
            fill: Kernel::new("frugal_gi/sky/fill", "fill_sky", &fill, &filling),
            weigh: Kernel::new("frugal_gi/sky/weigh", "weigh_sky", &weigh, &weighing)
                .with_group(OccluderBuffers::layout()),
            sample: Kernel::new("frugal_gi/sky/sample", "sample_sky", &sample, &sampling),
        }
    }
}

impl SkyKernels {
    /// Whether the pipelines are compiled. Queues them if they are not.
    pub(super) fn are_ready(&mut self, cache: &PipelineCache) -> bool {
        [&mut self.fill, &mut self.weigh, &mut self.sample].map(|kernel| {
            kernel.queue(cache, Vec::new());
            kernel.get(cache, &[]).is_some()
        }) == [true; 3]
    }
}

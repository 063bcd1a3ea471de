//! The passes that integrate, weight and sample a sky.

use std::sync::atomic::Ordering;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_2d_array,
    texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::Shader;
use bevy::utils::default;

use super::camera::{STRATA, STRATA_PER_GROUP, SkyCamera};
use crate::gi::compute::{CameraInputs, bind_group, compute_pass};
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::{GiView, SkySource};

/// Layouts of the passes, and pipelines, which are queued once a camera has a sky.
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
        let sample = BindGroupLayoutEntries::sequential(compute, (read(), read(), read(), write()));
        Self {
            layouts: [
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/fill", &fill),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/weigh", &weigh),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/sky/sample", &sample),
            ],
            shaders: [
                load_embedded_asset!(world, "fill.wgsl"),
                load_embedded_asset!(world, "weigh.wgsl"),
                load_embedded_asset!(world, "sample.wgsl"),
            ],
            pipelines: None,
        }
    }
}

impl SkyPipelines {
    /// Whether the pipelines are compiled. Queues them if they are not.
    pub(super) fn are_ready(&mut self, cache: &PipelineCache) -> bool {
        let pipelines = self.queue(cache);
        pipelines.into_iter().all(|pipeline| cache.get_compute_pipeline(pipeline).is_some())
    }

    fn queue(&mut self, cache: &PipelineCache) -> [CachedComputePipelineId; 3] {
        let Self { layouts, shaders, pipelines } = self;
        *pipelines.get_or_insert_with(|| {
            let names = ["fill_sky", "weigh_sky", "sample_sky"];
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

/// In a GI camera's view: integrates the sky when it changed; weights and samples it then and when
/// VPLs are sampled.
pub(in crate::gi) fn sample(
    view: ViewQuery<(&SkyCamera, &SkySource, &GiView, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<SkyPipelines>,
    occluders: Res<OccluderBuffers>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, source, gi_view, prepass, view_offset) = view.into_inner();
    if !gi_view.work.sample && camera.is_filled.load(Ordering::Relaxed) {
        return;
    }
    let Some([Some(fill), Some(weigh), Some(sample)]) =
        pipelines.pipelines.map(|ids| ids.map(|id| cache.get_compute_pipeline(id)))
    else {
        return;
    };
    let Some(inputs) = CameraInputs::new(prepass, &view_uniforms) else { return };
    let (Some(image), Some(traced), true) =
        (images.get(source.specular), occluders.bind_group(), camera.is_active)
    else {
        return;
    };
    let [fill_layout, weigh_layout, sample_layout] = &pipelines.layouts;
    let faces = image.texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    });
    let filling = bind_group(
        &context,
        &cache,
        fill_layout,
        &BindGroupEntries::sequential((
            &faces,
            camera.reading_buffer.as_entire_binding(),
            camera.strata.as_entire_binding(),
        )),
    );
    let weighing = bind_group(
        &context,
        &cache,
        weigh_layout,
        &BindGroupEntries::sequential((
            inputs.g_buffer,
            inputs.depth,
            inputs.views,
            camera.strata.as_entire_binding(),
            camera.importance.as_entire_binding(),
        )),
    );
    let sampling = bind_group(
        &context,
        &cache,
        sample_layout,
        &BindGroupEntries::sequential((
            camera.strata.as_entire_binding(),
            camera.importance.as_entire_binding(),
            camera.plan_buffer.as_entire_binding(),
            camera.samples.as_entire_binding(),
        )),
    );
    let again = gi_view.work.samples_again() && camera.is_filled.load(Ordering::Relaxed);
    compute_pass(&mut context, "bevy_frugal_gi/sky", &[], |pass| {
        if again {
            pass.set_bind_group(0, &sampling, &[]);
            pass.set_pipeline(sample);
            return pass.dispatch_workgroups(1, 1, 1);
        }
        if !camera.is_filled.swap(true, Ordering::Relaxed) {
            pass.set_bind_group(0, &filling, &[]);
            pass.set_pipeline(fill);
            pass.dispatch_workgroups(STRATA / 64, 1, 1);
        }
        pass.set_bind_group(0, &weighing, &[view_offset.offset]);
        pass.set_bind_group(1, traced, &[]);
        pass.set_pipeline(weigh);
        pass.dispatch_workgroups(STRATA / STRATA_PER_GROUP, 1, 1);
        pass.set_bind_group(0, &sampling, &[]);
        pass.set_pipeline(sample);
        pass.dispatch_workgroups(1, 1, 1);
    });
}

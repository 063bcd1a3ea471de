//! The passes that integrate, weight and sample a sky.

use std::sync::atomic::Ordering;

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniformOffset, ViewUniforms};
use bevy::utils::default;

use super::camera::{STRATA, STRATA_PER_GROUP, SkyCamera, SkyKernels};
use crate::gi::compute::{CameraInputs, compute_pass};
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::{GiView, SkySource};

/// In a GI camera's view: integrates the sky when it changed; weights and samples it then and when
/// VPLs are sampled.
pub(in crate::gi) fn sample(
    view: ViewQuery<(&SkyCamera, &SkySource, &GiView, &ViewPrepassTextures, &ViewUniformOffset)>,
    kernels: Res<SkyKernels>,
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
    let SkyKernels { fill, weigh, sample } = &*kernels;
    let (Some(fill_pipeline), Some(weigh_pipeline), Some(sample_pipeline)) =
        (fill.get(&cache, &[]), weigh.get(&cache, &[]), sample.get(&cache, &[]))
    else {
        return;
    };
    let Some(inputs) = CameraInputs::new(prepass, &view_uniforms) else { return };
    let (Some(image), Some(traced), true) =
        (images.get(source.specular), occluders.bind_group(), camera.is_active)
    else {
        return;
    };
    let faces = image.texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    });
    let filling = fill.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            &faces,
            camera.reading_buffer.as_entire_binding(),
            camera.strata.as_entire_binding(),
        )),
    );
    let weighing = weigh.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            inputs.g_buffer,
            inputs.depth,
            inputs.views,
            camera.strata.as_entire_binding(),
            camera.importance.as_entire_binding(),
        )),
    );
    let sampling = sample.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            camera.strata.as_entire_binding(),
            camera.importance.as_entire_binding(),
            camera.plan_buffer.as_entire_binding(),
            camera.samples.as_entire_binding(),
        )),
    );
    let again = gi_view.work.samples_again() && camera.is_filled.load(Ordering::Relaxed);
    compute_pass(&mut context, "frugal_gi/sky", &[], |pass| {
        if again {
            pass.set_bind_group(0, &sampling, &[]);
            pass.set_pipeline(sample_pipeline);
            return pass.dispatch_workgroups(1, 1, 1);
        }
        if !camera.is_filled.swap(true, Ordering::Relaxed) {
            pass.set_bind_group(0, &filling, &[]);
            pass.set_pipeline(fill_pipeline);
            pass.dispatch_workgroups(STRATA / 64, 1, 1);
        }
        pass.set_bind_group(0, &weighing, &[view_offset.offset]);
        pass.set_bind_group(1, traced, &[]);
        pass.set_pipeline(weigh_pipeline);
        pass.dispatch_workgroups(STRATA / STRATA_PER_GROUP, 1, 1);
        pass.set_bind_group(0, &sampling, &[]);
        pass.set_pipeline(sample_pipeline);
        pass.dispatch_workgroups(1, 1, 1);
    });
}

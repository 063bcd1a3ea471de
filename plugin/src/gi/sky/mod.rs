//! The sky as a light source: a camera's environment map, importance-sampled with visibility, and
//! shadowed by rays.
//!
//! | pass | when | job |
//! |---|---|---|
//! | `fill.wgsl` | when the map changes | integrates the map over strata of equal solid angle |
//! | `weigh.wgsl` | when VPLs are sampled | importance of each stratum to the visible surfaces, by rays |
//! | `sample.wgsl` | when VPLs are sampled | samples directions that represent the whole sky |
//! | `dim.wgsl` | while GI comes or goes | dims Bevy's own diffuse light of the map |
//! | `gather/gather.wgsl` | when the camera gathers | irradiance of each pixel from its samples |
//!
//! Sky samples are separate from the VPLs of bounced light. The sky is infinitely far away, so it
//! is sampled by direction. Indoors most of it is occluded; a ray shared by sky and bounce would
//! find neither.

mod ambient;
mod camera;

use std::sync::atomic::Ordering;

use bevy::app::{App, SubApp};
use bevy::asset::embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniformOffset, ViewUniforms};
use bevy::shader::load_shader_library;
use bevy::utils::default;

use super::compute::{CameraInputs, compute_pass};
use super::schedule::PassSystems;
use super::trace::OccluderBuffers;
use super::view::{GiView, SkySource};
use super::vpl::VplView;
pub(super) use ambient::take_out_diffuse;
use camera::SkyKernels;
pub(super) use camera::{
    SKY_LIGHT_BYTES, STEPS, STRATA, STRATA_PER_GROUP, SkyCamera, SkyInputs, SkyReading, prepare,
};

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "sky.wgsl");
    embedded_asset!(app, "fill.wgsl");
    embedded_asset!(app, "weigh.wgsl");
    embedded_asset!(app, "sample.wgsl");
    embedded_asset!(app, "dim.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<SkyKernels>()
        .init_gpu_resource::<ambient::Cubes>()
        .add_systems(Core3d, (sample, ambient::dim).in_set(PassSystems::Sky));
}

/// The six faces of a cube map, for shaders that load or store texels.
fn faces(texture: &Texture) -> TextureView {
    texture.create_view(&TextureViewDescriptor {
        dimension: Some(TextureViewDimension::D2Array),
        ..default()
    })
}

/// In a GI camera's view: integrates the sky when it changed; weights and samples it then and when
/// VPLs are sampled.
pub(super) fn sample(
    view: ViewQuery<(
        &SkyCamera,
        &SkySource,
        &GiView,
        &VplView,
        &ViewPrepassTextures,
        &ViewUniformOffset,
    )>,
    kernels: Res<SkyKernels>,
    occluders: Res<OccluderBuffers>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, source, gi_view, vpl, prepass, view_offset) = view.into_inner();
    if !gi_view.work.sample && camera.is_filled.load(Ordering::Relaxed) {
        return;
    }
    let SkyKernels { fill, weigh, sample, .. } = &*kernels;
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
    let faces = faces(&image.texture);
    let [reading, strata, importance, plan, samples] = [
        &camera.reading_buffer,
        &camera.strata,
        &camera.importance,
        &vpl.plan_buffer,
        &camera.samples,
    ]
    .map(|buffer| buffer.as_entire_binding());
    let filling = BindGroupEntries::sequential((&faces, reading, strata.clone()));
    let filling = fill.bind(&context, &cache, &filling);
    let CameraInputs { g_buffer, depth, views } = inputs;
    let weighing = (g_buffer, depth, views, strata.clone(), importance.clone());
    let weighing = weigh.bind(&context, &cache, &BindGroupEntries::sequential(weighing));
    let sampling = BindGroupEntries::sequential((strata, importance, plan, samples));
    let sampling = sample.bind(&context, &cache, &sampling);
    let again = gi_view.work.samples_again() && camera.is_filled.load(Ordering::Relaxed);
    compute_pass(&mut context, "frugal_gi/sky", &[], |pass| {
        if !again {
            if !camera.is_filled.swap(true, Ordering::Relaxed) {
                pass.set_bind_group(0, &filling, &[]);
                pass.set_pipeline(fill_pipeline);
                pass.dispatch_workgroups(STRATA / 64, 1, 1);
            }
            pass.set_bind_group(0, &weighing, &[view_offset.offset]);
            pass.set_bind_group(1, traced, &[]);
            pass.set_pipeline(weigh_pipeline);
            pass.dispatch_workgroups(STRATA / STRATA_PER_GROUP, 1, 1);
        }
        pass.set_bind_group(0, &sampling, &[]);
        pass.set_pipeline(sample_pipeline);
        pass.dispatch_workgroups(1, 1, 1);
    });
}

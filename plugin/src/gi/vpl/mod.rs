//! Virtual point lights: sampled for each GI camera from the texels of its maps.

mod passes;
mod view;

use bevy::app::{App, SubApp};
use bevy::asset::embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};
use bevy::shader::load_shader_library;

use super::compute::{CameraInputs, compute_pass, drop_with};
use super::schedule::PassSystems;
use super::texels::TexelStore;
use super::trace::OccluderBuffers;
use super::view::GiView;
pub(super) use passes::{
    BLOCK, CHUNK, MANY, SampleInputs, TILE_GROUP, TILE_POINTS, VplKernels, WEIGH_GROUP,
};
pub(super) use view::{
    IMPORTANCE_POINT_BYTES, IMPORTANCE_POINTS, IMPORTANCE_POINTS_BYTES, VPL_BYTES, VplPlan,
    VplView, prepare,
};

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "vpl.wgsl");
    embedded_asset!(app, "tile_visibility.wgsl");
    embedded_asset!(app, "weigh.wgsl");
    embedded_asset!(app, "sample.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<VplKernels>()
        .add_observer(drop_with::<GiView, VplView>)
        .add_systems(Core3d, sample.in_set(PassSystems::Vpl));
}

/// In a GI camera's view: weights the texels of its maps and samples its VPLs.
pub(super) fn sample(
    view: ViewQuery<(&GiView, &VplView, &ViewPrepassTextures, &ViewUniformOffset)>,
    kernels: Res<VplKernels>,
    store: Res<TexelStore>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, prepass, view_offset) = view.into_inner();
    if !view.work.sample {
        return;
    }
    let traced = occluders.bind_group().filter(|_| view.gi.visibility.rays() > 0);
    let again = view.work.samples_again();
    let Some(camera) = CameraInputs::new(prepass, &view_uniforms) else { return };
    let (Some(texels), Some(buffers)) = (&store.texels, &vpl.sampling) else { return };
    let inputs = SampleInputs {
        camera,
        view_offset: view_offset.offset,
        texels,
        buffers,
        importance: &buffers.importance,
        vpls: &vpl.vpls,
        plan: (&vpl.plan_buffer, vpl.plan.count()),
    };
    let passes = kernels.passes(&context, &cache, traced.is_some(), inputs);
    let (Some(pick), Some(passes)) = (kernels.pick_importance_points.get(&cache, &[]), passes)
    else {
        return;
    };
    let clears = traced.filter(|_| !again).map(|_| (&buffers.occluded_tiles, 0, None));
    compute_pass(&mut context, "frugal_gi/vpl", clears.as_slice(), |pass| {
        if again {
            return passes.sample_again(pass);
        }
        pass.set_bind_group(0, &passes.weighing, &[view_offset.offset]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        if let Some(traced) = traced {
            passes.trace_tiles(pass, traced);
        }
        passes.weigh(pass);
        passes.sample(pass);
    });
}

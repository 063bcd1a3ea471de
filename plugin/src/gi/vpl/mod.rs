//! Virtual point lights: sampled for each GI camera from the texels of its maps.

mod passes;
mod plan;
mod view;

use bevy::app::{App, Plugin};
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::{ShaderDefVal, load_shader_library};

use super::compute::{CameraInputs, Kernel, compute_pass, definitions, drop_with, read, write};
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::texels::TexelStore;
use super::trace::OccluderBuffers;
use super::view::GiView;
pub(super) use passes::SampleInputs;
pub(super) use plan::VplPlan;
pub(super) use view::{
    IMPORTANCE_POINT_BYTES, IMPORTANCE_POINTS, IMPORTANCE_POINTS_BYTES, VplView,
};

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test compares it with the shader.
pub(super) const VPL_BYTES: u64 = 48;

/// Tiles and rows of a workgroup of `tile_visibility.wgsl`, texels and rows of one of `weigh.wgsl`.
pub(super) const TILE_GROUP: [u32; 2] = [2, 16];
pub(super) const WEIGH_GROUP: [u32; 2] = [16, 4];

pub(super) struct VplPlugin;

impl Plugin for VplPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "vpl.wgsl");
        load_shader_library!(app, "stratum.wgsl");
        load_shader_library!(app, "plan.wgsl");
        load_shader_library!(app, "importance.wgsl");
        embedded_asset!(app, "tile_visibility.wgsl");
        embedded_asset!(app, "weigh.wgsl");
        embedded_asset!(app, "sample.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<VplKernels>()
            .add_observer(drop_with::<GiView, VplView>)
            .add_systems(Render, view::prepare.in_set(PrepareSystems::Vpl))
            .add_systems(Core3d, sample.in_set(PassSystems::Vpl));
    }
}

#[derive(Resource)]
pub(super) struct VplKernels {
    pick_importance_points: Kernel,
    find_defensive_term: Kernel,
    weigh_texels: Kernel,
    trace_tiles: Kernel,
    accumulate_rows: Kernel,
    accumulate_maps: Kernel,
    sample: Kernel,
}

/// `TILE_VISIBILITY` where importance points have traced the tiles.
fn weigh_variant(is_traced: bool) -> Vec<ShaderDefVal> {
    definitions([(is_traced, "TILE_VISIBILITY")])
}

/// The tile visibility always tests alpha masks.
fn tile_variant() -> Vec<ShaderDefVal> {
    vec!["MASKS".into()]
}

impl FromWorld for VplKernels {
    fn from_world(world: &mut World) -> Self {
        let compute = ShaderStages::COMPUTE;
        let (g_buffer, depth) = (texture_2d(TextureSampleType::Uint), texture_depth_2d());
        let view = uniform_buffer::<ViewUniform>(true);
        let weighing = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), read(), write(), write(), read()),
        );
        let tracing =
            BindGroupLayoutEntries::sequential(compute, (view, read(), read(), read(), write()));
        let sampling = BindGroupLayoutEntries::sequential(
            compute,
            (read(), read(), write(), write(), write(), read()),
        );
        let (weigh, sample) =
            (load_embedded_asset!(world, "weigh.wgsl"), load_embedded_asset!(world, "sample.wgsl"));
        let tiles = load_embedded_asset!(world, "tile_visibility.wgsl");
        let cache = world.resource::<PipelineCache>();
        let weigh =
            |entry_point| Kernel::new("frugal_gi/vpl/weigh", entry_point, &weigh, &weighing);
        let variants = || [false, true].map(weigh_variant);
        let sample = |entry_point| {
            Kernel::new("frugal_gi/vpl/sample", entry_point, &sample, &sampling)
                .queued(cache, [vec![]])
        };
        Self {
            pick_importance_points: weigh("pick_importance_points").queued(cache, [vec![]]),
            find_defensive_term: weigh("find_defensive_term").queued(cache, variants()),
            weigh_texels: weigh("weigh_texels").queued(cache, variants()),
            trace_tiles: Kernel::new("frugal_gi/vpl/tiles", "trace_tiles", &tiles, &tracing)
                .with_group(OccluderBuffers::layout())
                .queued(cache, [tile_variant()]),
            accumulate_rows: sample("accumulate_rows"),
            accumulate_maps: sample("accumulate_maps"),
            sample: sample("sample_vpls"),
        }
    }
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
        plan: (&vpl.plan_buffer, vpl.plan.slots()),
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
        pass.set_bind_group(0, passes.weighing(), &[view_offset.offset]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        if let Some(traced) = traced {
            passes.trace_tiles(pass, traced);
        }
        passes.weigh(pass);
        passes.sample(pass);
    });
}

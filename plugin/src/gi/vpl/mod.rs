//! Virtual point lights: sampled for each GI camera from the texels of its maps.

mod buffers;
mod plan;
mod steps;
mod view;

use bevy::app::{App, Plugin};
use bevy::asset::{Handle, embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d,
    uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::{Shader, load_shader_library};
use bevy::utils::default;

use super::compute::{CameraInputs, compute_pass};
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::texels::TexelStore;
use super::trace::OccluderBuffers;
use super::view::GiView;
pub(super) use buffers::{IMPORTANCE_POINT_BYTES, IMPORTANCE_POINTS, IMPORTANCE_POINTS_BYTES};
pub(super) use plan::VplPlan;
pub(super) use steps::SampleInputs;
pub(super) use view::VplView;

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
            .init_gpu_resource::<VplPipelines>()
            .add_systems(Render, view::prepare.in_set(PrepareSystems::Vpl))
            .add_systems(Core3d, sample.in_set(PassSystems::Vpl));
    }
}

#[derive(Resource)]
pub(super) struct VplPipelines {
    weigh_layout: BindGroupLayoutDescriptor,
    pick_importance_points: CachedComputePipelineId,
    /// Without tile visibility, and with it.
    find_defensive_term: [CachedComputePipelineId; 2],
    weigh_texels: [CachedComputePipelineId; 2],
    tile_layout: BindGroupLayoutDescriptor,
    trace_tiles: CachedComputePipelineId,
    sample_layout: BindGroupLayoutDescriptor,
    accumulate_rows: CachedComputePipelineId,
    accumulate_maps: CachedComputePipelineId,
    sample: CachedComputePipelineId,
}

impl FromWorld for VplPipelines {
    fn from_world(world: &mut World) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let write = || storage_buffer_sized(false, None);
        let weigh_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl/weigh",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    read(),
                    read(),
                    write(),
                    write(),
                    read(),
                ),
            ),
        );
        let tile_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl/tile_visibility",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (uniform_buffer::<ViewUniform>(true), read(), read(), read(), write()),
            ),
        );
        let sample_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl/sample",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (read(), read(), write(), write(), write(), read()),
            ),
        );
        let (weigh, sample) =
            (load_embedded_asset!(world, "weigh.wgsl"), load_embedded_asset!(world, "sample.wgsl"));
        let tile_visibility = load_embedded_asset!(world, "tile_visibility.wgsl");
        let cache = world.resource::<PipelineCache>();
        let queue = |shader: &Handle<Shader>,
                     layout: &[&BindGroupLayoutDescriptor],
                     entry_point: &'static str,
                     definition: Option<&str>| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/vpl/{entry_point}").into()),
                layout: layout.iter().map(|layout| (*layout).clone()).collect(),
                shader: shader.clone(),
                shader_defs: definition.map(Into::into).into_iter().collect(),
                entry_point: Some(entry_point.into()),
                ..default()
            })
        };
        Self {
            pick_importance_points: queue(&weigh, &[&weigh_layout], "pick_importance_points", None),
            find_defensive_term: [None, Some("TILE_VISIBILITY")].map(|visibility| {
                queue(&weigh, &[&weigh_layout], "find_defensive_term", visibility)
            }),
            weigh_texels: [None, Some("TILE_VISIBILITY")]
                .map(|visibility| queue(&weigh, &[&weigh_layout], "weigh_texels", visibility)),
            trace_tiles: queue(
                &tile_visibility,
                &[&tile_layout, &OccluderBuffers::layout()],
                "trace_tiles",
                Some("MASKS"),
            ),
            accumulate_rows: queue(&sample, &[&sample_layout], "accumulate_rows", None),
            accumulate_maps: queue(&sample, &[&sample_layout], "accumulate_maps", None),
            sample: queue(&sample, &[&sample_layout], "sample_vpls", None),
            weigh_layout,
            tile_layout,
            sample_layout,
        }
    }
}

/// In a GI camera's view: weights the texels of its maps and samples its VPLs.
pub(super) fn sample(
    view: ViewQuery<(&GiView, &VplView, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<VplPipelines>,
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
    let steps = pipelines.steps(&context, &cache, traced.is_some(), inputs);
    let (Some(pick), Some(steps)) =
        (cache.get_compute_pipeline(pipelines.pick_importance_points), steps)
    else {
        return;
    };
    let clears = traced.filter(|_| !again).map(|_| (&buffers.occluded_tiles, 0, None));
    compute_pass(&mut context, "bevy_frugal_gi/vpl", clears.as_slice(), |pass| {
        if again {
            return steps.sample_again(pass);
        }
        pass.set_bind_group(0, steps.weighing(), &[view_offset.offset]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        if let Some(traced) = traced {
            steps.trace_tiles(pass, traced);
        }
        steps.weigh(pass);
        steps.sample(pass);
    });
}

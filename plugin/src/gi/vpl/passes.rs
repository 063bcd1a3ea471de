//! From importance points to virtual point lights: the passes that sampling for a camera's image
//! and for its patches share.

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderContext;
use bevy::render::view::ViewUniform;
use bevy::shader::ShaderDefVal;

use super::view::{IMPORTANCE_POINTS, SamplingBuffers};
use crate::gi::compute::{CameraInputs, Kernel, definitions, read, write};
use crate::gi::texels::TILE;
use crate::gi::trace::OccluderBuffers;

/// Tiles and rows of a workgroup of `tile_visibility.wgsl`.
pub(in crate::gi) const TILE_GROUP: [u32; 2] = [2, 16];
/// Importance points of a thread of `tile_visibility.wgsl`.
pub(in crate::gi) const TILE_POINTS: u32 = 4;
/// Blocks of texels of a workgroup of `weigh.wgsl`.
pub(in crate::gi) const WEIGH_GROUP: [u32; 2] = [16, 4];
/// Texels above which a block has more than one, and its side then.
pub(in crate::gi) const MANY: u32 = 65_536;
pub(in crate::gi) const BLOCK: u32 = 4;
/// Rows that a workgroup of `sample.wgsl` adds up.
pub(in crate::gi) const CHUNK: u32 = 64;

#[derive(Resource)]
pub(in crate::gi) struct VplKernels {
    pub(super) pick_importance_points: Kernel,
    find_defensive_term: Kernel,
    weigh_texels: Kernel,
    trace_tiles: Kernel,
    accumulate_rows: Kernel,
    sample: Kernel,
}

/// `TILE_VISIBILITY` where importance points have traced the tiles.
fn weigh_variant(is_traced: bool) -> Vec<ShaderDefVal> {
    definitions([(is_traced, "TILE_VISIBILITY")])
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
            (read(), read(), write(), write(), write(), read(), read(), read()),
        );
        let (weigh, sample) =
            (load_embedded_asset!(world, "weigh.wgsl"), load_embedded_asset!(world, "sample.wgsl"));
        let tiles = load_embedded_asset!(world, "tile_visibility.wgsl");
        let cache = world.resource::<PipelineCache>();
        let weigh =
            |entry_point| Kernel::new("frugal_gi/vpl/weigh", entry_point, &weigh, &weighing);
        let variants = || [false, true].map(weigh_variant);
        let sample =
            |entry_point| Kernel::new("frugal_gi/vpl/sample", entry_point, &sample, &sampling);
        Self {
            pick_importance_points: weigh("pick_importance_points").queued(cache, [vec![]]),
            find_defensive_term: weigh("find_defensive_term").queued(cache, variants()),
            weigh_texels: weigh("weigh_texels").queued(cache, variants()),
            trace_tiles: Kernel::new("frugal_gi/vpl/tiles", "trace_tiles", &tiles, &tracing)
                .with_group(OccluderBuffers::layout())
                .queued(cache, [vec![]]),
            accumulate_rows: sample("accumulate_rows").queued(cache, [vec![]]),
            sample: sample("sample_vpls").queued(cache, variants()),
        }
    }
}

/// Inputs and output of the sampling.
pub(in crate::gi) struct SampleInputs<'a> {
    pub camera: CameraInputs<'a>,
    pub view_offset: u32,
    /// Of the store.
    pub texels: &'a Buffer,
    pub buffers: &'a SamplingBuffers,
    /// Points that stand for everything to be lit: `vpl/vpl.wgsl`'s `ImportancePoints`.
    pub importance: &'a Buffer,
    pub vpls: &'a Buffer,
    /// The VPLs' plan, and its number of slots.
    pub plan: (&'a Buffer, u32),
}

/// The passes, ready to be encoded.
pub(in crate::gi) struct SamplingPasses<'a> {
    trace_tiles: &'a ComputePipeline,
    find_defensive_term: &'a ComputePipeline,
    weigh_texels: &'a ComputePipeline,
    accumulate_rows: &'a ComputePipeline,
    sample: &'a ComputePipeline,
    tracing: BindGroup,
    /// Of the weights, and of the pass before them, which picks importance points.
    pub(super) weighing: BindGroup,
    sampling: BindGroup,
    inputs: SampleInputs<'a>,
}

impl VplKernels {
    /// The passes, once all pipelines are compiled. `is_traced`: with tile visibility.
    pub(in crate::gi) fn passes<'a>(
        &self,
        context: &RenderContext,
        cache: &'a PipelineCache,
        is_traced: bool,
        inputs: SampleInputs<'a>,
    ) -> Option<SamplingPasses<'a>> {
        let SampleInputs { camera, texels, buffers, importance, vpls, plan, .. } = &inputs;
        let weighing = BindGroupEntries::sequential((
            camera.g_buffer,
            camera.depth,
            camera.views.clone(),
            texels.as_entire_binding(),
            buffers.row_table.as_entire_binding(),
            importance.as_entire_binding(),
            buffers.texel_cdf.as_entire_binding(),
            buffers.occluded_tiles.as_entire_binding(),
        ));
        let tracing = BindGroupEntries::sequential((
            camera.views.clone(),
            texels.as_entire_binding(),
            buffers.row_table.as_entire_binding(),
            importance.as_entire_binding(),
            buffers.occluded_tiles.as_entire_binding(),
        ));
        let sampling = BindGroupEntries::sequential((
            texels.as_entire_binding(),
            buffers.row_table.as_entire_binding(),
            buffers.texel_cdf.as_entire_binding(),
            buffers.row_cdf.as_entire_binding(),
            vpls.as_entire_binding(),
            plan.0.as_entire_binding(),
            importance.as_entire_binding(),
            buffers.occluded_tiles.as_entire_binding(),
        ));
        let variant = weigh_variant(is_traced);
        Some(SamplingPasses {
            trace_tiles: self.trace_tiles.get(cache, &[])?,
            find_defensive_term: self.find_defensive_term.get(cache, &variant)?,
            weigh_texels: self.weigh_texels.get(cache, &variant)?,
            accumulate_rows: self.accumulate_rows.get(cache, &[])?,
            sample: self.sample.get(cache, &variant)?,
            tracing: self.trace_tiles.bind(context, cache, &tracing),
            weighing: self.weigh_texels.bind(context, cache, &weighing),
            sampling: self.sample.bind(context, cache, &sampling),
            inputs,
        })
    }
}

impl SamplingPasses<'_> {
    /// Traces tile visibility; group 1 holds the occluders. `occluded_tiles` must have been cleared
    /// before.
    pub(crate) fn trace_tiles(&self, pass: &mut ComputePass, occluders: &BindGroup) {
        pass.set_bind_group(0, &self.tracing, &[self.inputs.view_offset]);
        pass.set_bind_group(1, occluders, &[]);
        pass.set_pipeline(self.trace_tiles);
        pass.dispatch_workgroups(
            self.inputs.buffers.longest_row.div_ceil(TILE).div_ceil(TILE_GROUP[0]),
            self.rows().div_ceil(TILE_GROUP[1]),
            // A row that shares its tile with no other traces a ray from every point.
            (IMPORTANCE_POINTS as u32).div_ceil(TILE_POINTS),
        );
    }

    /// Weights all texels by their importance.
    pub(crate) fn weigh(&self, pass: &mut ComputePass) {
        pass.set_bind_group(0, &self.weighing, &[self.inputs.view_offset]);
        pass.set_pipeline(self.find_defensive_term);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(self.weigh_texels);
        let SamplingBuffers { longest_row, texel_cdf, .. } = &self.inputs.buffers;
        let side = if texel_cdf.size() / 4 > u64::from(MANY) { BLOCK } else { 1 };
        pass.dispatch_workgroups(
            longest_row.div_ceil(side * WEIGH_GROUP[0]),
            self.rows().div_ceil(side * WEIGH_GROUP[1]),
            1,
        );
    }

    /// Samples VPLs in proportion to the weights.
    pub(crate) fn sample(&self, pass: &mut ComputePass) {
        pass.set_bind_group(0, &self.sampling, &[]);
        pass.set_pipeline(self.accumulate_rows);
        pass.dispatch_workgroups(self.rows().div_ceil(CHUNK), 1, 1);
        self.sample_again(pass);
    }

    /// Samples VPLs by the cumulative sums of an earlier frame.
    pub(crate) fn sample_again(&self, pass: &mut ComputePass) {
        pass.set_bind_group(0, &self.sampling, &[]);
        pass.set_pipeline(self.sample);
        pass.dispatch_workgroups(self.inputs.plan.1.div_ceil(64), 1, 1);
    }

    fn rows(&self) -> u32 {
        self.inputs.buffers.rows.len() as u32
    }
}

//! Virtual point lights: drawn for each GI camera from the texels of its maps.

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{storage_buffer_read_only_sized, storage_buffer_sized};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::utils::default;
use bytemuck::{Pod, Zeroable};

use super::gather::GiCamera;
use super::rsm::RsmStore;

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test holds it against the shader.
pub(super) const VPL_BYTES: u64 = 48;

/// `vpl/sample.wgsl`'s `Row`: one row of one of a camera's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct MapRow {
    /// Index into the row sums.
    pub row: u32,
    /// Index of its first texel.
    pub first_texel: u32,
    /// Texels in it.
    pub length: u32,
}

#[derive(Resource)]
pub(super) struct VplPipelines {
    pub layout: BindGroupLayoutDescriptor,
    accumulate_maps: CachedComputePipelineId,
    sample: CachedComputePipelineId,
}

impl FromWorld for VplPipelines {
    fn from_world(world: &mut World) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let write = || storage_buffer_sized(false, None);
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl",
            &BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (read(), read(), read(), read(), write(), write(), read())),
        );
        let shader = load_embedded_asset!(world, "sample.wgsl");
        let cache = world.resource::<PipelineCache>();
        let queue = |entry_point: &'static str| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/vpl/{entry_point}").into()),
                layout: vec![layout.clone()],
                shader: shader.clone(),
                entry_point: Some(entry_point.into()),
                ..default()
            })
        };
        let accumulate_maps = queue("accumulate_maps");
        let sample = queue("sample_vpls");
        Self { accumulate_maps, sample, layout }
    }
}

/// In a GI camera's view: draws its VPLs.
pub(super) fn sample(
    view: ViewQuery<&GiCamera>,
    pipelines: Res<VplPipelines>,
    store: Res<RsmStore>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let camera = view.into_inner();
    let (Some(buffers), Some(accumulate), Some(sample)) =
        (&store.buffers, cache.get_compute_pipeline(pipelines.accumulate_maps), cache.get_compute_pipeline(pipelines.sample))
    else {
        return;
    };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/vpl",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            buffers.texels.as_entire_binding(),
            buffers.texel_cdf.as_entire_binding(),
            buffers.row_sums.as_entire_binding(),
            camera.rows.as_entire_binding(),
            camera.row_cdf.as_entire_binding(),
            camera.vpls.as_entire_binding(),
            camera.plan_buffer.as_entire_binding(),
        )),
    );
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/vpl");
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/vpl"), timestamp_writes: None });
        pass.set_bind_group(0, &bind_group, &[]);
        pass.set_pipeline(accumulate);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(sample);
        pass.dispatch_workgroups(camera.plan.slots().div_ceil(64), 1, 1);
    }
    span.end(context.command_encoder());
}

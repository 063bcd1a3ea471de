//! Virtual point lights: drawn for each GI camera from the texels of its maps.

mod buffers;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::Shader;
use bevy::utils::default;

use super::gather::GiCamera;
use super::rsm::RsmStore;
use super::visibility::OccluderBuffers;
use buffers::TILE;
pub(super) use buffers::{DrawingBuffers, MapRow, RECEIVER_BYTES};

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test holds it against the shader.
pub(super) const VPL_BYTES: u64 = 48;

/// Threads in a workgroup of `see.wgsl`.
const SEE_GROUP: u32 = 32;

#[derive(Resource)]
pub(super) struct VplPipelines {
    weigh_layout: BindGroupLayoutDescriptor,
    pick_receivers: CachedComputePipelineId,
    /// Without a look at what hides texels, and with one.
    find_floor: [CachedComputePipelineId; 2],
    weigh_texels: [CachedComputePipelineId; 2],
    see_layout: BindGroupLayoutDescriptor,
    see_tiles: CachedComputePipelineId,
    draw_layout: BindGroupLayoutDescriptor,
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
        let see_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl/see",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (uniform_buffer::<ViewUniform>(true), read(), read(), read(), write()),
            ),
        );
        let draw_layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/vpl/draw",
            &BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (read(), read(), write(), write(), write(), read())),
        );
        let (weigh, sample) = (load_embedded_asset!(world, "weigh.wgsl"), load_embedded_asset!(world, "sample.wgsl"));
        let see = load_embedded_asset!(world, "see.wgsl");
        let cache = world.resource::<PipelineCache>();
        let queue =
            |shader: &Handle<Shader>, layout: &[&BindGroupLayoutDescriptor], entry_point: &'static str, definition: Option<&str>| {
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
            pick_receivers: queue(&weigh, &[&weigh_layout], "pick_receivers", None),
            find_floor: [None, Some("SEEING")].map(|seeing| queue(&weigh, &[&weigh_layout], "find_floor", seeing)),
            weigh_texels: [None, Some("SEEING")].map(|seeing| queue(&weigh, &[&weigh_layout], "weigh_texels", seeing)),
            see_tiles: queue(&see, &[&see_layout, &OccluderBuffers::layout()], "see_tiles", Some("MASKS")),
            accumulate_rows: queue(&sample, &[&draw_layout], "accumulate_rows", None),
            accumulate_maps: queue(&sample, &[&draw_layout], "accumulate_maps", None),
            sample: queue(&sample, &[&draw_layout], "sample_vpls", None),
            weigh_layout,
            see_layout,
            draw_layout,
        }
    }
}

/// The passes from weights to VPLs.
pub(super) struct Drawing<'a> {
    accumulate_rows: &'a ComputePipeline,
    accumulate_maps: &'a ComputePipeline,
    sample: &'a ComputePipeline,
}

impl Drawing<'_> {
    /// Draws VPLs for so many slots of a plan.
    pub fn dispatch(&self, pass: &mut ComputePass, bind_group: &BindGroup, buffers: &DrawingBuffers, slots: u32) {
        pass.set_bind_group(0, bind_group, &[]);
        pass.set_pipeline(self.accumulate_rows);
        pass.dispatch_workgroups((buffers.rows.len() as u32).div_ceil(64), 1, 1);
        pass.set_pipeline(self.accumulate_maps);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(self.sample);
        pass.dispatch_workgroups(slots.div_ceil(64), 1, 1);
    }
}

impl VplPipelines {
    /// What draws, once it is compiled.
    pub fn drawing<'a>(&self, cache: &'a PipelineCache) -> Option<Drawing<'a>> {
        Some(Drawing {
            accumulate_rows: cache.get_compute_pipeline(self.accumulate_rows)?,
            accumulate_maps: cache.get_compute_pipeline(self.accumulate_maps)?,
            sample: cache.get_compute_pipeline(self.sample)?,
        })
    }

    /// From the weights in `buffers` into `vpls`, as `plan` shares them out.
    pub fn bind_drawing(
        &self,
        device: &RenderDevice,
        cache: &PipelineCache,
        texels: &Buffer,
        buffers: &DrawingBuffers,
        vpls: &Buffer,
        plan: &Buffer,
    ) -> BindGroup {
        device.create_bind_group(
            "bevy_frugal_gi/vpl/draw",
            &cache.get_bind_group_layout(&self.draw_layout),
            &BindGroupEntries::sequential((
                texels.as_entire_binding(),
                buffers.row_table.as_entire_binding(),
                buffers.texel_cdf.as_entire_binding(),
                buffers.row_cdf.as_entire_binding(),
                vpls.as_entire_binding(),
                plan.as_entire_binding(),
            )),
        )
    }
}

/// In a GI camera's view: weighs the texels of its maps and draws its VPLs.
pub(super) fn sample(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<VplPipelines>,
    store: Res<RsmStore>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    if !camera.work.draw {
        return;
    }
    let ready = |id| cache.get_compute_pipeline(id);
    let traced = occluders.bind_group().filter(|_| camera.visibility.rays() > 0);
    let kind = usize::from(traced.is_some());
    let (Some(pick), Some(find_floor), Some(weigh), Some(see)) = (
        ready(pipelines.pick_receivers),
        ready(pipelines.find_floor[kind]),
        ready(pipelines.weigh_texels[kind]),
        ready(pipelines.see_tiles),
    ) else {
        return;
    };
    let (Some(draw), Some(texels)) = (pipelines.drawing(&cache), &store.texels) else { return };
    let (Some(g_buffer), Some(depth), Some(views)) = (prepass.deferred_view(), prepass.depth_view(), view_uniforms.uniforms.binding())
    else {
        return;
    };
    let Some(buffers) = &camera.drawing else { return };
    let device = context.render_device();
    let weighing = device.create_bind_group(
        "bevy_frugal_gi/vpl/weigh",
        &cache.get_bind_group_layout(&pipelines.weigh_layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views.clone(),
            texels.as_entire_binding(),
            buffers.row_table.as_entire_binding(),
            buffers.receivers.as_entire_binding(),
            buffers.texel_cdf.as_entire_binding(),
            buffers.hidden.as_entire_binding(),
        )),
    );
    let seeing = device.create_bind_group(
        "bevy_frugal_gi/vpl/see",
        &cache.get_bind_group_layout(&pipelines.see_layout),
        &BindGroupEntries::sequential((
            views,
            texels.as_entire_binding(),
            buffers.row_table.as_entire_binding(),
            buffers.receivers.as_entire_binding(),
            buffers.hidden.as_entire_binding(),
        )),
    );
    let drawing = pipelines.bind_drawing(device, &cache, texels, buffers, &camera.vpls, &camera.plan_buffer);
    let rows = buffers.rows.len() as u32;
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/vpl");
    if traced.is_some() {
        context.command_encoder().clear_buffer(&buffers.hidden, 0, None);
    }
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/vpl"), timestamp_writes: None });
        pass.set_bind_group(0, &weighing, &[view_offset.offset]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        if let Some(traced) = traced {
            pass.set_bind_group(0, &seeing, &[view_offset.offset]);
            pass.set_bind_group(1, traced, &[]);
            pass.set_pipeline(see);
            pass.dispatch_workgroups(buffers.longest_row.div_ceil(TILE).div_ceil(SEE_GROUP), rows, 1);
            pass.set_bind_group(0, &weighing, &[view_offset.offset]);
        }
        pass.set_pipeline(find_floor);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(weigh);
        pass.dispatch_workgroups(buffers.longest_row.div_ceil(64), rows, 1);
        draw.dispatch(&mut pass, &drawing, buffers, camera.plan.slots());
    }
    span.end(context.command_encoder());
}

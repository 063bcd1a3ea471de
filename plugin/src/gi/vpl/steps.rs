//! From receivers to virtual point lights: the steps that drawing for a camera's picture and for
//! its patches have in common.

use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;

use super::buffers::DrawingBuffers;
use super::{SEE_GROUP, VplPipelines};
use crate::gi::texels::TILE;

/// What is drawn from, and into what.
pub(in crate::gi) struct Drawn<'a> {
    /// The camera's.
    pub g_buffer: &'a TextureView,
    pub depth: &'a TextureView,
    pub views: BindingResource<'a>,
    pub view_offset: u32,
    /// Of the store.
    pub texels: &'a Buffer,
    pub buffers: &'a DrawingBuffers,
    /// Points that stand for everything to be lit: `vpl/importance.wgsl`'s `ImportancePoints`.
    pub importance: &'a Buffer,
    pub vpls: &'a Buffer,
    /// How these are shared out, and how many slots that takes.
    pub plan: (&'a Buffer, u32),
}

/// The steps, ready to be encoded.
pub(in crate::gi) struct Steps<'a> {
    see: &'a ComputePipeline,
    find_floor: &'a ComputePipeline,
    weigh_texels: &'a ComputePipeline,
    accumulate_rows: &'a ComputePipeline,
    accumulate_maps: &'a ComputePipeline,
    sample: &'a ComputePipeline,
    seeing: BindGroup,
    weighing: BindGroup,
    drawing: BindGroup,
    drawn: Drawn<'a>,
}

impl VplPipelines {
    /// The steps, once all is compiled. `is_traced`: with a look at what hides texels.
    pub(in crate::gi) fn steps<'a>(
        &self,
        device: &RenderDevice,
        cache: &'a PipelineCache,
        is_traced: bool,
        drawn: Drawn<'a>,
    ) -> Option<Steps<'a>> {
        let Drawn { g_buffer, depth, views, texels, buffers, importance, vpls, plan, .. } = &drawn;
        let weighing = device.create_bind_group(
            "bevy_frugal_gi/vpl/weigh",
            &cache.get_bind_group_layout(&self.weigh_layout),
            &BindGroupEntries::sequential((
                *g_buffer,
                *depth,
                views.clone(),
                texels.as_entire_binding(),
                buffers.row_table.as_entire_binding(),
                importance.as_entire_binding(),
                buffers.texel_cdf.as_entire_binding(),
                buffers.hidden.as_entire_binding(),
            )),
        );
        let seeing = device.create_bind_group(
            "bevy_frugal_gi/vpl/see",
            &cache.get_bind_group_layout(&self.see_layout),
            &BindGroupEntries::sequential((
                views.clone(),
                texels.as_entire_binding(),
                buffers.row_table.as_entire_binding(),
                importance.as_entire_binding(),
                buffers.hidden.as_entire_binding(),
            )),
        );
        let drawing = device.create_bind_group(
            "bevy_frugal_gi/vpl/draw",
            &cache.get_bind_group_layout(&self.draw_layout),
            &BindGroupEntries::sequential((
                texels.as_entire_binding(),
                buffers.row_table.as_entire_binding(),
                buffers.texel_cdf.as_entire_binding(),
                buffers.row_cdf.as_entire_binding(),
                vpls.as_entire_binding(),
                plan.0.as_entire_binding(),
            )),
        );
        let ready = |id| cache.get_compute_pipeline(id);
        Some(Steps {
            see: ready(self.see_tiles)?,
            find_floor: ready(self.find_floor[usize::from(is_traced)])?,
            weigh_texels: ready(self.weigh_texels[usize::from(is_traced)])?,
            accumulate_rows: ready(self.accumulate_rows)?,
            accumulate_maps: ready(self.accumulate_maps)?,
            sample: ready(self.sample)?,
            seeing,
            weighing,
            drawing,
            drawn,
        })
    }
}

impl Steps<'_> {
    /// What weighing reads of the camera: for the step before it, which picks receivers.
    pub fn weighing(&self) -> &BindGroup {
        &self.weighing
    }

    /// Which receivers see which tiles; group 1 is what rays may meet. The buffer of what is hidden
    /// must have been cleared before.
    pub fn see(&self, pass: &mut ComputePass, occluders: &BindGroup) {
        pass.set_bind_group(0, &self.seeing, &[self.drawn.view_offset]);
        pass.set_bind_group(1, occluders, &[]);
        pass.set_pipeline(self.see);
        pass.dispatch_workgroups(
            self.drawn.buffers.longest_row.div_ceil(TILE).div_ceil(SEE_GROUP),
            self.rows(),
            1,
        );
    }

    /// Weighs all texels by what receivers could get of them.
    pub fn weigh(&self, pass: &mut ComputePass) {
        pass.set_bind_group(0, &self.weighing, &[self.drawn.view_offset]);
        pass.set_pipeline(self.find_floor);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(self.weigh_texels);
        pass.dispatch_workgroups(self.drawn.buffers.longest_row.div_ceil(64), self.rows(), 1);
    }

    /// Draws VPLs by the weights.
    pub fn draw(&self, pass: &mut ComputePass) {
        pass.set_bind_group(0, &self.drawing, &[]);
        pass.set_pipeline(self.accumulate_rows);
        pass.dispatch_workgroups(self.rows().div_ceil(64), 1, 1);
        pass.set_pipeline(self.accumulate_maps);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(self.sample);
        pass.dispatch_workgroups(self.drawn.plan.1.div_ceil(64), 1, 1);
    }

    fn rows(&self) -> u32 {
        self.drawn.buffers.rows.len() as u32
    }
}

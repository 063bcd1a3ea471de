//! A GI camera's buffers for its VPLs, and how samples lie among its pixels.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::render::render_resource::{Buffer, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bytemuck::{Pod, Zeroable};

use super::passes::CHUNK;
use crate::gi::compute::{bytes_of, empty_buffer, filled_buffer};
use crate::gi::settings::{FrugalGi, GiInterleave};
use crate::gi::texels::{TexelRow, same_layout};
use crate::gi::view::GiView;

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test compares it with the shader.
pub(in crate::gi) const VPL_BYTES: u64 = 48;

/// `vpl/vpl.wgsl`'s `Plan`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct VplPlan {
    /// Side of the square of low-resolution pixels among which the VPLs are interleaved.
    pub interleave: u32,
    /// Sets of VPLs and of sky samples: `interleave`².
    pub sets: u32,
    /// VPLs in each set: 1 to 1024, and 0 where there are no texels.
    pub per_set: u32,
    /// Sky samples in each set.
    pub sky_samples: u32,
    /// Which samples of the weights: 0 while something changes, others at rest.
    pub sequence: u32,
    /// Width and height of a low-resolution pixel, in pixels.
    pub cell: [u32; 2],
}

impl VplPlan {
    /// At least `vpl_count` VPLs in equal sets, but no more in a set than a pixel can evaluate. At
    /// full resolution, without a sky.
    pub(crate) fn new(vpl_count: u32, interleave: GiInterleave) -> Self {
        let side = interleave.side();
        let sets = side * side;
        let per_set = vpl_count
            .min(FrugalGi::MAX_VPL_COUNT)
            .div_ceil(sets)
            .clamp(1, FrugalGi::MAX_VPLS_PER_PIXEL);
        Self { interleave: side, sets, per_set, sky_samples: 0, sequence: 0, cell: [1; 2] }
    }

    /// VPLs in the buffer: one set behind the other.
    pub(crate) fn count(&self) -> u32 {
        self.sets * self.per_set
    }
}

/// The VPLs of a GI camera and the buffers of their sampling. In the render world.
#[derive(Component)]
pub(in crate::gi) struct VplView {
    /// The content of `plan_buffer`.
    pub plan: VplPlan,
    pub plan_buffer: Buffer,
    pub vpls: Buffer,
    /// `None` where the camera has no texels to sample: it then gathers only its sky.
    pub sampling: Option<SamplingBuffers>,
}

impl VplView {
    fn new(device: &RenderDevice, plan: VplPlan, view: &GiView) -> Self {
        let (plan_buffer, vpls) = plan_buffers(device, &plan);
        Self { plan, plan_buffer, vpls, sampling: sampling_buffers(device, view) }
    }

    /// VPLs that are sampled in this frame.
    pub(crate) fn sampled(&self, view: &GiView) -> u64 {
        if view.work.sample { self.plan.count().into() } else { 0 }
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        bytes_of([&self.plan_buffer, &self.vpls])
            + self.sampling.as_ref().map_or(0, SamplingBuffers::bytes)
    }
}

fn plan_buffers(device: &RenderDevice, plan: &VplPlan) -> (Buffer, Buffer) {
    let storage = BufferUsages::STORAGE;
    // No binding may be empty.
    let bytes = u64::from(plan.count().max(1)) * VPL_BYTES;
    (
        filled_buffer(device, "frugal_gi/vpl/plan", bytemuck::bytes_of(plan), storage),
        empty_buffer(device, "frugal_gi/vpl/vpls", bytes, storage | BufferUsages::COPY_SRC),
    )
}

fn sampling_buffers(device: &RenderDevice, view: &GiView) -> Option<SamplingBuffers> {
    (!view.rows.is_empty()).then(|| SamplingBuffers::new(device, Arc::clone(&view.rows)))
}

/// Gives every view the buffers that its plan and its rows of texels need.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<(Entity, &GiView, Option<&mut VplView>)>,
) {
    for (entity, view, held) in &mut views {
        let mut plan = VplPlan {
            sky_samples: view.sky_samples,
            cell: view.camera.cell.to_array(),
            ..VplPlan::new(view.gi.vpl_count, view.gi.interleave)
        };
        if view.rows.is_empty() {
            plan.per_set = 0;
        }
        let Some(mut held) = held else {
            commands.entity(entity).insert(VplView::new(&device, plan, view));
            continue;
        };
        plan.sequence = if view.work.sample { view.sequence } else { held.plan.sequence };
        let sets = |plan: &VplPlan| (plan.sets, plan.per_set);
        if sets(&held.plan) != sets(&plan) {
            (held.plan_buffer, held.vpls) = plan_buffers(&device, &plan);
        } else if held.plan != plan {
            queue.write_buffer(&held.plan_buffer, 0, bytemuck::bytes_of(&plan));
        }
        held.plan = plan;
        match &mut held.sampling {
            Some(sampling) if same_layout(&sampling.rows, &view.rows) => {
                if sampling.rows != view.rows {
                    sampling.set_rows(&queue, Arc::clone(&view.rows));
                }
            }
            None if view.rows.is_empty() => {}
            other => *other = sampling_buffers(&device, view),
        }
    }
}

/// Surface points that stand for all surfaces in view.
pub(in crate::gi) const IMPORTANCE_POINTS: u64 = 32;
/// Bytes of `vpl/vpl.wgsl`'s `ImportancePoint`. A test compares it with the shader.
pub(in crate::gi) const IMPORTANCE_POINT_BYTES: u64 = 32;

/// Bytes of its `ImportancePoints`.
pub(in crate::gi) const IMPORTANCE_POINTS_BYTES: u64 =
    16 + IMPORTANCE_POINTS * IMPORTANCE_POINT_BYTES;

/// Buffers between a camera's maps and its VPLs.
pub(in crate::gi) struct SamplingBuffers {
    /// The content of `row_table`.
    pub rows: Arc<Vec<TexelRow>>,
    /// Texels in the longest row.
    pub longest_row: u32,
    pub row_table: Buffer,
    pub importance: Buffer,
    /// For each tile, a bit for each importance point from which it is occluded.
    pub occluded_tiles: Buffer,
    /// Each texel's weight for this camera, then the weights' cumulative sums along each row.
    pub texel_cdf: Buffer,
    /// Cumulative sums of rows within chunks, then each chunk's sum.
    pub row_cdf: Buffer,
}

impl SamplingBuffers {
    /// Buffers for at least one row.
    pub(crate) fn new(device: &RenderDevice, rows: Arc<Vec<TexelRow>>) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let empty = |label, size| empty_buffer(device, label, size, usage);
        let texels = rows.iter().map(|row| u64::from(row.length)).sum::<u64>();
        Self {
            row_table: filled_buffer(
                device,
                "frugal_gi/vpl/rows",
                bytemuck::cast_slice(rows.as_slice()),
                usage,
            ),
            importance: empty("frugal_gi/vpl/importance", IMPORTANCE_POINTS_BYTES),
            occluded_tiles: empty(
                "frugal_gi/vpl/occluded_tiles",
                rows.last().map_or(1, |row| u64::from(row.end_tile())) * 4,
            ),
            texel_cdf: empty("frugal_gi/vpl/texel_cdf", texels * 4),
            row_cdf: empty(
                "frugal_gi/vpl/row_cdf",
                (rows.len() + rows.len().div_ceil(CHUNK as usize)) as u64 * 4,
            ),
            longest_row: rows.iter().map(|row| row.length).max().unwrap_or(0),
            rows,
        }
    }

    /// Samples other rows from now on, of the [same layout](crate::gi::texels::same_layout).
    pub(crate) fn set_rows(&mut self, queue: &RenderQueue, rows: Arc<Vec<TexelRow>>) {
        queue.write_buffer(&self.row_table, 0, bytemuck::cast_slice(rows.as_slice()));
        self.rows = rows;
    }

    pub(crate) fn bytes(&self) -> u64 {
        let Self { row_table, importance, occluded_tiles, texel_cdf, row_cdf, .. } = self;
        bytes_of([row_table, importance, occluded_tiles, texel_cdf, row_cdf])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_hold_all_vpls_and_no_more_than_a_pixel_evaluates() {
        for interleave in GiInterleave::ALL {
            for count in [1, 2, 31, 32, 100, 1024, 4096, FrugalGi::MAX_VPL_COUNT, u32::MAX] {
                let plan = VplPlan::new(count, interleave);
                assert!((1..=FrugalGi::MAX_VPLS_PER_PIXEL).contains(&plan.per_set));
                let wanted = count
                    .min(FrugalGi::MAX_VPL_COUNT)
                    .min(plan.sets * FrugalGi::MAX_VPLS_PER_PIXEL);
                assert!((wanted..wanted + plan.sets).contains(&plan.count()), "{count} {plan:?}");
            }
        }
    }
}

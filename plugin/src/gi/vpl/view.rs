//! A GI camera's buffers for its VPLs.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::buffers::SamplingBuffers;
use super::plan::VplPlan;
use crate::gi::texels::same_layout;
use crate::gi::view::GiView;

/// The VPLs of a GI camera and the buffers of their sampling. In the render world.
#[derive(Component)]
pub(in crate::gi) struct VplView {
    /// Interleaving of the VPLs.
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
        if view.work.sample { u64::from(self.plan.sets) * u64::from(self.plan.per_set) } else { 0 }
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        self.plan_buffer.size()
            + self.vpls.size()
            + self.sampling.as_ref().map_or(0, SamplingBuffers::bytes)
    }
}

fn plan_buffers(device: &RenderDevice, plan: &VplPlan) -> (Buffer, Buffer) {
    let plan_buffer = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("bevy_frugal_gi/vpl/plan"),
        contents: bytemuck::bytes_of(plan),
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
    });
    let vpls = device.create_buffer(&BufferDescriptor {
        label: Some("bevy_frugal_gi/vpl/vpls"),
        size: plan.buffer_bytes(),
        usage: BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    (plan_buffer, vpls)
}

fn sampling_buffers(device: &RenderDevice, view: &GiView) -> Option<SamplingBuffers> {
    (!view.rows.is_empty()).then(|| SamplingBuffers::new(device, Arc::clone(&view.rows)))
}

/// Gives every view the buffers that its plan and its rows of texels need.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    views: Query<(Entity, &GiView)>,
    mut held: Query<&mut VplView>,
    stale: Query<Entity, (With<VplView>, Without<GiView>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<VplView>();
    }
    for (entity, view) in &views {
        let plan = VplPlan::new(view.gi.vpl_count, view.gi.interleave);
        let plan = if view.rows.is_empty() { plan.without_vpls() } else { plan };
        let Ok(mut held) = held.get_mut(entity) else {
            commands.entity(entity).insert(VplView::new(&device, plan, view));
            continue;
        };
        let sequence = if view.work.sample { view.work.rested } else { held.plan.sequence };
        let plan = VplPlan { sequence, ..plan };
        if (VplPlan { sequence, ..held.plan }) != plan {
            (held.plan_buffer, held.vpls) = plan_buffers(&device, &plan);
        } else if held.plan.sequence != sequence {
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

//! The occluders on the GPU.

use std::sync::Arc;

use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::storage_buffer_read_only_sized;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::bvh::Node;
use super::data::{InstanceData, MeshData};
use super::occluders::GiOccluders;
use crate::gi::settings::FrugalGi;
use crate::gi::texels::TexelStore;
use crate::gi::view::SkySource;

/// Buffers of the tree over instances, the instances, the meshes' trees and their triangles: group
/// 1 of every shader that traces.
#[derive(Resource, Default)]
pub(in crate::gi) struct OccluderBuffers {
    held: Option<Held>,
}

struct Held {
    meshes: Arc<MeshData>,
    instances: Arc<InstanceData>,
    buffers: [Buffer; 4],
    bind_group: BindGroup,
}

impl OccluderBuffers {
    /// Layout of group 1. Not a field of the resource, since the renderer creates resources in no
    /// particular order.
    pub(crate) fn layout() -> BindGroupLayoutDescriptor {
        let read = || storage_buffer_read_only_sized(false, None);
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (read(), read(), read(), read()),
        );
        BindGroupLayoutDescriptor::new("bevy_frugal_gi/trace", &entries)
    }

    /// Group 1, while a camera traces.
    pub(crate) fn bind_group(&self) -> Option<&BindGroup> {
        self.held.as_ref().map(|held| &held.bind_group)
    }

    /// Whether any triangle has holes, which shaders test only where MASKS is defined.
    pub(crate) fn are_masked(&self) -> bool {
        self.held.as_ref().is_some_and(|held| held.meshes.is_masked)
    }

    /// The buffers of group 1, in the order of its bindings.
    pub(crate) fn buffers(&self) -> Option<&[Buffer; 4]> {
        self.held.as_ref().map(|held| &held.buffers)
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        self.held.as_ref().map_or(0, |held| held.buffers.iter().map(|buffer| buffer.size()).sum())
    }
}

/// Uploads changes to the GPU; drops all buffers while no camera traces rays.
pub(super) fn prepare(
    mut buffers: ResMut<OccluderBuffers>,
    occluders: Res<GiOccluders>,
    store: Res<TexelStore>,
    cameras: Query<(&FrugalGi, Has<SkySource>)>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
) {
    // Depends on this frame's extracted cameras, not on the main world's occluders: a camera whose
    // settings changed after those were made traces what exists.
    let is_lit = |gi: &FrugalGi, has_sky: bool| {
        store.texels.is_some() || has_sky && gi.environment_samples > 0
    };
    if !cameras.iter().any(|(gi, has_sky)| gi.traces() && is_lit(gi, has_sky)) {
        buffers.held = None;
        return;
    }
    let held = buffers.held.take();
    let same = |held: &Held| {
        [
            Arc::ptr_eq(&held.meshes, &occluders.meshes),
            Arc::ptr_eq(&held.instances, &occluders.instances),
        ]
    };
    let [meshes_same, instances_same] = held.as_ref().map_or([false; 2], same);
    if meshes_same && instances_same {
        buffers.held = held;
        return;
    }
    let (meshes, instances) = (Arc::clone(&occluders.meshes), Arc::clone(&occluders.instances));
    let contents: [(&'static str, &[u8], bool); 4] = [
        ("bevy_frugal_gi/trace/instance_nodes", node_bytes(&instances.nodes), instances_same),
        (
            "bevy_frugal_gi/trace/instances",
            bytemuck::cast_slice(&instances.instances),
            instances_same,
        ),
        ("bevy_frugal_gi/trace/mesh_nodes", node_bytes(&meshes.nodes), meshes_same),
        ("bevy_frugal_gi/trace/triangles", bytemuck::cast_slice(&meshes.triangles), meshes_same),
    ];
    let old = held.map(|held| held.buffers);
    let new = std::array::from_fn(|index| {
        let (label, bytes, unchanged) = contents[index];
        // No binding may be empty; behind a node that no ray intersects, nothing is read.
        let bytes = if bytes.is_empty() { &[0; 64] } else { bytes };
        match old.as_ref().map(|old| &old[index]) {
            Some(buffer) if unchanged => buffer.clone(),
            // Data of unchanged size keeps its buffer.
            Some(buffer) if buffer.size() == bytes.len() as u64 => {
                queue.write_buffer(buffer, 0, bytes);
                buffer.clone()
            }
            _ => device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some(label),
                contents: bytes,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            }),
        }
    });
    let entries = new.each_ref().map(|buffer: &Buffer| buffer.as_entire_binding());
    let [a, b, c, d] = entries;
    let bind_group = device.create_bind_group(
        "bevy_frugal_gi/trace",
        &cache.get_bind_group_layout(&OccluderBuffers::layout()),
        &BindGroupEntries::sequential((a, b, c, d)),
    );
    buffers.held = Some(Held { meshes, instances, buffers: new, bind_group });
}

fn node_bytes(nodes: &[Node]) -> &[u8] {
    if nodes.is_empty() { bytemuck::bytes_of(&Node::NOTHING) } else { bytemuck::cast_slice(nodes) }
}

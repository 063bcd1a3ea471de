//! The occluders on the GPU.

use bevy::ecs::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::bvh::Node;
use super::mesh::{Instance, TriangleWords};
use super::mirror::Upload;
use super::occluders::OccluderScene;
use super::wide::WideNode;
use crate::gi::compute::{empty_buffer, read};
use crate::gi::settings::FrugalGi;
use crate::gi::texels::TexelStore;
use crate::gi::view::SkySource;

/// A buffer that holds a copy of an array of the main world.
#[derive(Debug, Default)]
struct ArrayBuffer {
    buffer: Option<Buffer>,
    /// The version that it holds once `pending` is uploaded; 0: none.
    version: u64,
    /// What it lacks.
    pending: Option<Upload>,
}

impl ArrayBuffer {
    /// Number of items of `bytes` each that it has room for.
    fn capacity(&self, bytes: usize) -> usize {
        self.buffer.as_ref().map_or(0, |buffer| buffer.size() as usize / bytes)
    }

    /// Takes what it lacks out of the main world: `missing` of a version and a capacity.
    fn extract(&mut self, bytes: usize, missing: impl Fn(u64, usize) -> Option<Upload>) {
        if let Some(upload) = missing(self.version, self.capacity(bytes)) {
            // Changes on top of what is not uploaded yet are no changes of what the buffer holds.
            let is_on_top = self.pending.is_some() && !upload.is_whole;
            let upload = if is_on_top { missing(0, 0) } else { Some(upload) };
            self.version = upload.as_ref().map_or(0, |upload| upload.version);
            self.pending = upload;
        }
    }

    /// Uploads what it lacks; `nothing` stands in an empty array. Returns the number of bytes, and
    /// whether it is another buffer now.
    fn upload(
        &mut self,
        label: &'static str,
        nothing: &[u8],
        bytes: usize,
        (device, queue): (&RenderDevice, &RenderQueue),
    ) -> (u64, bool) {
        let pending = self.pending.take();
        let Some(upload) = pending.or_else(|| self.buffer.is_none().then(Upload::default)) else {
            return (0, false);
        };
        let needed = upload.count.max(nothing.len().div_ceil(bytes));
        let is_new = self.capacity(bytes) < needed;
        if is_new {
            // One that has grown is likely to grow again.
            let spare = if self.buffer.is_some() { needed / 2 } else { 0 };
            let most = device.limits().max_storage_buffer_binding_size / bytes as u64;
            let count = ((needed + spare) as u64).min(most).max(needed as u64);
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            self.buffer = Some(empty_buffer(device, label, count * bytes as u64, usage));
        }
        let Some(buffer) = &self.buffer else { return (0, false) };
        let mut written = 0;
        if upload.count == 0 {
            queue.write_buffer(buffer, 0, nothing);
        }
        for (offset, bytes) in upload.pieces.iter().filter(|(_, bytes)| !bytes.is_empty()) {
            queue.write_buffer(buffer, *offset as u64, bytes);
            written += bytes.len() as u64;
        }
        (written, is_new)
    }

    /// Drops the buffer, if any.
    fn drop_buffer(&mut self) {
        if self.buffer.is_some() {
            *self = Self::default();
        }
    }
}

/// Buffers of the tree over instances, the instances, the meshes' trees and their triangles: group
/// 1 of every shader that traces.
#[derive(Resource, Default)]
pub(in crate::gi) struct OccluderBuffers {
    /// In the order of the bindings.
    arrays: [ArrayBuffer; 4],
    bind_group: Option<BindGroup>,
    uploaded: u64,
}

/// What a copy of one of the arrays, by its binding, lacks that holds a version with room for so many
/// items.
fn missing(scene: &OccluderScene, array: usize, version: u64, room: usize) -> Option<Upload> {
    match array {
        0 => scene.top.nodes.missing(version, room),
        1 => scene.top.instances.missing(version, room),
        2 => scene.geometry.nodes.missing(version, room),
        _ => scene.geometry.triangles.missing(version, room),
    }
}

/// Bytes of an item of each array.
const ITEM_BYTES: [usize; 4] =
    [size_of::<Node>(), size_of::<Instance>(), size_of::<WideNode>(), size_of::<TriangleWords>()];

const LABELS: [&str; 4] = [
    "frugal_gi/trace/instance_nodes",
    "frugal_gi/trace/instances",
    "frugal_gi/trace/mesh_nodes",
    "frugal_gi/trace/triangles",
];

impl OccluderBuffers {
    /// Layout of group 1. Not a field of the resource, since the renderer creates resources in no
    /// particular order.
    pub(crate) fn layout() -> BindGroupLayoutDescriptor {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (read(), read(), read(), read()),
        );
        BindGroupLayoutDescriptor::new("frugal_gi/trace", &entries)
    }

    /// Group 1, while a camera traces.
    pub(crate) fn bind_group(&self) -> Option<&BindGroup> {
        self.bind_group.as_ref()
    }

    /// The buffers of group 1, in the order of its bindings.
    pub(crate) fn buffers(&self) -> Option<[&Buffer; 4]> {
        let [a, b, c, d] = self.arrays.each_ref().map(|array| array.buffer.as_ref());
        Some([a?, b?, c?, d?])
    }

    /// Bytes held on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        self.arrays.iter().filter_map(|array| Some(array.buffer.as_ref()?.size())).sum()
    }

    /// Bytes uploaded in this frame.
    pub(crate) fn uploaded(&self) -> u64 {
        self.uploaded
    }
}

/// Takes what changed out of the main world.
pub(super) fn extract(mut buffers: ResMut<OccluderBuffers>, scene: Extract<Res<OccluderScene>>) {
    for (array, buffer) in buffers.arrays.iter_mut().enumerate() {
        buffer.extract(ITEM_BYTES[array], |version, room| missing(&scene, array, version, room));
    }
}

/// Uploads changes to the GPU; drops all buffers while no camera traces rays.
pub(in crate::gi) fn prepare(
    mut buffers: ResMut<OccluderBuffers>,
    store: Res<TexelStore>,
    cameras: Query<(&FrugalGi, Has<SkySource>)>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
) {
    let buffers = &mut *buffers;
    buffers.uploaded = 0;
    // Depends on this frame's extracted cameras, not on the main world's occluders: a camera whose
    // settings changed after those were made traces what exists.
    let is_lit = |gi: &FrugalGi, has_sky: bool| {
        store.texels.is_some() || has_sky && gi.environment_samples > 0
    };
    if !cameras.iter().any(|(gi, has_sky)| gi.traces() && is_lit(gi, has_sky)) {
        buffers.bind_group = None;
        buffers.arrays.iter_mut().for_each(ArrayBuffer::drop_buffer);
        return;
    }
    // No binding may be empty; behind a node that no ray intersects, nothing is read.
    let nothing = [0_u8; 64];
    for (index, array) in buffers.arrays.iter_mut().enumerate() {
        let nothing = match index {
            0 => bytemuck::bytes_of(&Node::NOTHING),
            _ => &nothing[..ITEM_BYTES[index]],
        };
        let gpu = (&*device, &*queue);
        let (written, is_new) = array.upload(LABELS[index], nothing, ITEM_BYTES[index], gpu);
        buffers.uploaded += written;
        if is_new {
            buffers.bind_group = None;
        }
    }
    if buffers.bind_group.is_none()
        && let Some([a, b, c, d]) = buffers.buffers()
    {
        let [a, b, c, d] = [a, b, c, d].map(|buffer| buffer.as_entire_binding());
        buffers.bind_group = Some(device.create_bind_group(
            "frugal_gi/trace",
            &cache.get_bind_group_layout(&OccluderBuffers::layout()),
            &BindGroupEntries::sequential((a, b, c, d)),
        ));
    }
}

//! What every compute pass needs: its pipelines, its inputs from the camera, its buffers, its
//! encoding, and the device's limits.

use bevy::asset::Handle;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy::render::settings::WgpuLimits;
use bevy::render::view::ViewUniforms;
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

/// An entry point of a shader, with its layout, and its pipelines by shader definitions.
pub(crate) struct Kernel {
    label: &'static str,
    entry_point: &'static str,
    shader: Handle<Shader>,
    layouts: Vec<BindGroupLayoutDescriptor>,
    pipelines: HashMap<Vec<ShaderDefVal>, CachedComputePipelineId>,
}

impl Kernel {
    /// `entries`: of bind group 0. Pipelines are created when they are queued.
    pub(crate) fn new(
        label: &'static str,
        entry_point: &'static str,
        shader: &Handle<Shader>,
        entries: &[BindGroupLayoutEntry],
    ) -> Self {
        let layouts = vec![BindGroupLayoutDescriptor::new(label, entries)];
        Self { label, entry_point, shader: shader.clone(), layouts, pipelines: default() }
    }

    /// With `layout` for bind group 1.
    pub(crate) fn with_group(mut self, layout: BindGroupLayoutDescriptor) -> Self {
        self.layouts.push(layout);
        self
    }

    /// With the pipelines of these definitions queued.
    pub(crate) fn queued<const N: usize>(
        mut self,
        cache: &PipelineCache,
        variants: [Vec<ShaderDefVal>; N],
    ) -> Self {
        variants.into_iter().for_each(|definitions| self.queue(cache, definitions));
        self
    }

    /// Queues the pipeline of these definitions, unless it was before.
    pub(crate) fn queue(&mut self, cache: &PipelineCache, definitions: Vec<ShaderDefVal>) {
        let Self { label, entry_point, shader, layouts, pipelines } = self;
        pipelines.entry(definitions).or_insert_with_key(|definitions| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("{label}/{entry_point}").into()),
                layout: layouts.clone(),
                shader: shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some((*entry_point).into()),
                ..default()
            })
        });
    }

    /// The pipeline of these definitions, if it is queued and compiled.
    pub(crate) fn get<'a>(
        &self,
        cache: &'a PipelineCache,
        definitions: &[ShaderDefVal],
    ) -> Option<&'a ComputePipeline> {
        cache.get_compute_pipeline(*self.pipelines.get(definitions)?)
    }

    /// Bind group 0.
    pub(crate) fn bind(
        &self,
        context: &RenderContext,
        cache: &PipelineCache,
        entries: &[BindGroupEntry],
    ) -> BindGroup {
        let layout = cache.get_bind_group_layout(&self.layouts[0]);
        context.render_device().create_bind_group(self.label, &layout, entries)
    }
}

/// The shader definitions of what is so.
pub(in crate::gi) fn definitions<const N: usize>(all: [(bool, &str); N]) -> Vec<ShaderDefVal> {
    all.into_iter().filter(|(is_so, _)| *is_so).map(|(_, name)| name.into()).collect()
}

/// A storage buffer in a layout, to read.
pub(in crate::gi) fn read() -> BindGroupLayoutEntryBuilder {
    storage_buffer_read_only_sized(false, None)
}

/// A storage buffer in a layout, to write.
pub(crate) fn write() -> BindGroupLayoutEntryBuilder {
    storage_buffer_sized(false, None)
}

/// A buffer of `size` bytes, zeroed.
pub(in crate::gi) fn empty_buffer(
    device: &RenderDevice,
    label: &'static str,
    size: u64,
    usage: BufferUsages,
) -> Buffer {
    let label = Some(label);
    device.create_buffer(&BufferDescriptor { label, size, usage, mapped_at_creation: false })
}

/// A buffer of `contents`, which may be written again.
pub(in crate::gi) fn filled_buffer(
    device: &RenderDevice,
    label: &'static str,
    contents: &[u8],
    usage: BufferUsages,
) -> Buffer {
    let usage = usage | BufferUsages::COPY_DST;
    device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage })
}

/// Bytes of buffers on the GPU.
pub(in crate::gi) fn bytes_of<const N: usize>(buffers: [&Buffer; N]) -> u64 {
    buffers.iter().map(|buffer| buffer.size()).sum()
}

/// An observer that drops a camera's `Own` together with its `Owner`.
pub(in crate::gi) fn drop_with<Owner: Component, Own: Component>(
    removed: On<Remove, Owner>,
    mut commands: Commands,
) {
    commands.entity(removed.entity).try_remove::<Own>();
}

/// A camera's G-buffer, depth and uniforms, which most passes bind first.
pub(in crate::gi) struct CameraInputs<'a> {
    pub g_buffer: &'a TextureView,
    pub depth: &'a TextureView,
    /// Of all views; the camera's offset selects its own.
    pub views: BindingResource<'a>,
}

impl<'a> CameraInputs<'a> {
    /// `None` until Bevy has prepared all of them.
    pub(crate) fn new(prepass: &'a ViewPrepassTextures, views: &'a ViewUniforms) -> Option<Self> {
        Some(Self {
            g_buffer: prepass.deferred_view()?,
            depth: prepass.depth_view()?,
            views: views.uniforms.binding()?,
        })
    }
}

/// Encodes a compute pass under a time span. `name` is of both, and of the span among Bevy's render
/// diagnostics. `clears` are buffers, or parts of them, that are zeroed first.
pub(crate) fn compute_pass(
    context: &mut RenderContext,
    name: &'static str,
    clears: &[(&Buffer, BufferAddress, Option<BufferAddress>)],
    encode: impl FnOnce(&mut ComputePass),
) {
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), name);
    for (buffer, offset, size) in clears {
        context.command_encoder().clear_buffer(buffer, *offset, *size);
    }
    let descriptor = ComputePassDescriptor { label: Some(name), timestamp_writes: None };
    encode(&mut context.command_encoder().begin_compute_pass(&descriptor));
    span.end(context.command_encoder());
}

/// Limits of a device; without one, the least that WebGPU guarantees.
pub(in crate::gi) fn limits_of(device: Option<&RenderDevice>) -> WgpuLimits {
    device.map_or_else(WgpuLimits::default, RenderDevice::limits)
}

/// Bytes of the largest storage buffer.
pub(in crate::gi) fn largest_storage_buffer(limits: &WgpuLimits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smaller_limit_counts() {
        let limits = WgpuLimits { max_buffer_size: 1 << 20, ..Default::default() };
        assert_eq!(largest_storage_buffer(&limits), 1 << 20);
        assert_eq!(largest_storage_buffer(&WgpuLimits::default()), 128 << 20);
    }
}

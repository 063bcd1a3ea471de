//! What every compute pass needs: its inputs from the camera, its bind groups, its encoding, and
//! the device's limits.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy::render::settings::WgpuLimits;
use bevy::render::view::ViewUniforms;

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

/// A bind group of `layout`, labelled as the layout is.
pub(in crate::gi) fn bind_group(
    context: &RenderContext,
    cache: &PipelineCache,
    layout: &BindGroupLayoutDescriptor,
    entries: &[BindGroupEntry],
) -> BindGroup {
    context.render_device().create_bind_group(
        layout.label.as_ref(),
        &cache.get_bind_group_layout(layout),
        entries,
    )
}

/// Encodes a compute pass under a time span. `name` is of both, and of the span among Bevy's render
/// diagnostics. `clears` are buffers, or parts of them, that are zeroed first.
pub(in crate::gi) fn compute_pass(
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

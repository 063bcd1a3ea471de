//! The adapter that the renderer will run on: Bevy panics without one.

use std::sync::OnceLock;

use crate::power::{Adapter, AdapterKind};

/// The adapter, and the instance that found it. The instance is kept so that the driver stays
/// loaded between stages: on NVIDIA's, processes that opened one stage after another found no
/// adapter any more after three to thirty of them.
static FOUND: OnceLock<(wgpu::Instance, Adapter)> = OnceLock::new();

/// The adapter that the renderer will choose; `None` if there is none.
pub fn adapter() -> Option<Adapter> {
    if let Some((_, adapter)) = FOUND.get() {
        return Some(adapter.clone());
    }
    let (instance, adapter) = find()?;
    Some(FOUND.get_or_init(|| (instance, adapter)).1.clone())
}

fn find() -> Option<(wgpu::Instance, Adapter)> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends =
        wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY | wgpu::Backends::SECONDARY);
    let instance = wgpu::Instance::new(descriptor);
    let options = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::from_env()
            .unwrap_or(wgpu::PowerPreference::HighPerformance),
        ..Default::default()
    };
    let adapter = bevy::tasks::block_on(instance.request_adapter(&options)).ok()?;
    let adapter = Adapter::from(&adapter.get_info());
    Some((instance, adapter))
}

/// Whether the renderer runs on the CPU.
pub fn software_adapter() -> bool {
    adapter().is_some_and(|adapter| adapter.kind == AdapterKind::Software)
}

//! The rendering adapter, for the choice of a meter.

use crate::power::MeterError;

/// Kind of the rendering adapter, for the choice of a meter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum AdapterKind {
    /// Software rendering on the CPU (lavapipe, WARP, SwiftShader).
    Software,
    /// A GPU.
    Hardware,
    /// Unknown, or no renderer.
    #[default]
    Unknown,
}

/// The rendering adapter, as its caller or the renderer describes it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adapter {
    /// CPU or GPU.
    pub kind: AdapterKind,
    /// Name reported by the graphics API, such as "NVIDIA GeForce RTX 3080". Empty where unknown.
    pub name: String,
    /// PCI address, `domain:bus:device.function`, such as "0000:01:00.0". Empty where unknown.
    /// Distinguishes boards of the same name.
    pub pci_bus_id: String,
    /// PCI identifier of the vendor, such as 0x1002; 0 where unknown.
    pub vendor_id: u32,
    /// PCI identifier of the device, such as 0x163f; 0 where unknown.
    pub device_id: u32,
    /// Whether the GPU is part of the processor's package, and its power part of the package's.
    pub is_integrated: bool,
}

/// PCI identifiers of vendors that have meters here.
pub(crate) mod vendor {
    pub(crate) const AMD: u32 = 0x1002;
    pub(crate) const INTEL: u32 = 0x8086;
    #[cfg(feature = "nvml")]
    pub(crate) const NVIDIA: u32 = 0x10de;
}

/// Why a meter of all programs is not chosen for software rendering.
const CPU_TIME_IS_BETTER: &str =
    "it contains all programs, the CPU time of this one orders settings better; request it by name";

/// Why a meter of a GPU is not chosen for software rendering.
pub(crate) const RENDERS_ON_CPU: &str =
    "the adapter renders on the CPU, which this meter does not cover";

impl From<&wgpu::AdapterInfo> for Adapter {
    fn from(info: &wgpu::AdapterInfo) -> Self {
        // Every kind is named, so that a renamed one does not compile.
        let (kind, is_integrated) = match info.device_type {
            wgpu::DeviceType::Cpu => (AdapterKind::Software, false),
            wgpu::DeviceType::IntegratedGpu => (AdapterKind::Hardware, true),
            wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::VirtualGpu => {
                (AdapterKind::Hardware, false)
            }
            wgpu::DeviceType::Other => (AdapterKind::Unknown, false),
        };
        Self {
            kind,
            name: info.name.clone(),
            pci_bus_id: info.device_pci_bus_id.clone(),
            vendor_id: info.vendor,
            device_id: info.device,
            is_integrated,
        }
    }
}

impl Adapter {
    /// Fails where `meter`, of `whole` with its integrated GPU and all programs, is not to be chosen
    /// for this adapter.
    pub(crate) fn is_part_of(&self, meter: &str, whole: &str) -> Result<(), MeterError> {
        let reason = match self.kind {
            AdapterKind::Hardware if self.is_integrated => return Ok(()),
            AdapterKind::Hardware => format!("the GPU is not part of {whole}"),
            AdapterKind::Software => CPU_TIME_IS_BETTER.to_owned(),
            AdapterKind::Unknown => {
                format!("the adapter is not known to be part of {whole}; request it by name")
            }
        };
        Err(MeterError::unavailable(meter, reason))
    }

    /// PCI identifier of the vendor; `None` where unknown.
    pub(crate) fn vendor(&self) -> Option<u32> {
        (self.vendor_id != 0).then_some(self.vendor_id)
    }
}

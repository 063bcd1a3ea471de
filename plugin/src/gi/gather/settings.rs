//! Settings of the gather's dispatch for each set: plain arithmetic, no renderer.

use bytemuck::{Pod, Zeroable};

use crate::gi::settings::GiPixelFraction;
use crate::gi::vpl::VplPlan;

/// Bytes from one dispatch's settings to the next.
pub(super) const SETTINGS_STRIDE: u64 = 256;

/// `gather/gather.wgsl`'s `Gather`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct GatherSettings {
    pub cell_width: u32,
    pub cell_height: u32,
    pub interleave_offset: [u32; 2],
}

/// The settings of every set's dispatch, each at its dynamic offset.
pub(super) fn settings_bytes(plan: &VplPlan, fraction: GiPixelFraction) -> Vec<u8> {
    let (cell_width, cell_height) = fraction.cell();
    let mut bytes = vec![0; plan.sets as usize * SETTINGS_STRIDE as usize];
    for (set, chunk) in (0..).zip(bytes.chunks_exact_mut(SETTINGS_STRIDE as usize)) {
        let settings = GatherSettings {
            cell_width,
            cell_height,
            interleave_offset: plan.interleave_offset(set).to_array(),
        };
        chunk[..size_of::<GatherSettings>()].copy_from_slice(bytemuck::bytes_of(&settings));
    }
    bytes
}

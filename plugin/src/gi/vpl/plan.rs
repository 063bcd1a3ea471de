//! Interleaving of a camera's VPLs among its pixels: plain arithmetic, no renderer.

use bevy::math::UVec2;
use bytemuck::{Pod, Zeroable};

use crate::gi::settings::{FrugalGi, GiInterleave};

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test compares it with the shader.
pub(in crate::gi) const VPL_BYTES: u64 = 48;
/// Sets begin at multiples of so many VPLs: 16 × 48 bytes is a multiple of 256, the alignment of
/// uniform offsets.
const STRIDE: u32 = 16;

/// `vpl/plan.wgsl`'s `Plan`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct VplPlan {
    /// Side of the square of low-resolution pixels among which the VPLs are interleaved.
    pub interleave: u32,
    /// Sets of VPLs: `interleave`².
    pub sets: u32,
    /// VPLs in each set: 1 to 1024, and 0 where there are no texels.
    pub per_set: u32,
    /// VPLs from one set to the next in the buffer.
    pub stride: u32,
    /// Which samples of the weights: 0 while something changes, others at rest.
    pub sequence: u32,
}

impl VplPlan {
    /// At least `vpl_count` VPLs in equal sets, but no more in a set than a pixel can evaluate.
    pub(crate) fn new(vpl_count: u32, interleave: GiInterleave) -> Self {
        let side = interleave.side();
        let sets = side * side;
        let per_set = vpl_count
            .min(FrugalGi::MAX_VPL_COUNT)
            .div_ceil(sets)
            .clamp(1, FrugalGi::MAX_VPLS_PER_PIXEL);
        Self {
            interleave: side,
            sets,
            per_set,
            stride: per_set.next_multiple_of(STRIDE),
            sequence: 0,
        }
    }

    /// The same without VPLs, where there are no texels to sample.
    #[must_use]
    pub(crate) fn without_vpls(self) -> Self {
        Self { per_set: 0, ..self }
    }

    /// VPLs in the buffer, padding of sets included.
    pub(crate) fn slots(&self) -> u32 {
        self.sets * self.stride
    }

    /// Bytes of the buffer of VPLs: at every set's offset the shader's whole array fits.
    pub(crate) fn buffer_bytes(&self) -> u64 {
        u64::from((self.sets - 1) * self.stride + FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES
    }

    /// Byte offset of a set.
    pub(crate) fn offset(&self, set: u32) -> u32 {
        set * self.stride * VPL_BYTES as u32
    }

    /// Interleave offset of a set: position of its low-resolution pixels in the square.
    pub(crate) fn interleave_offset(&self, set: u32) -> UVec2 {
        UVec2::new(set % self.interleave, set / self.interleave)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_hold_all_vpls_and_are_aligned_as_uniform_offsets() {
        for interleave in GiInterleave::ALL {
            for count in [1, 2, 31, 32, 100, 1024, 4096, FrugalGi::MAX_VPL_COUNT, u32::MAX] {
                let plan = VplPlan::new(count, interleave);
                assert!(
                    (1..=FrugalGi::MAX_VPLS_PER_PIXEL).contains(&plan.per_set)
                        && plan.per_set <= plan.stride
                );
                let wanted = count
                    .min(FrugalGi::MAX_VPL_COUNT)
                    .min(plan.sets * FrugalGi::MAX_VPLS_PER_PIXEL);
                assert!(
                    (wanted..wanted + plan.sets).contains(&(plan.sets * plan.per_set)),
                    "{count} {plan:?}"
                );
                let offsets: std::collections::HashSet<_> =
                    (0..plan.sets).map(|set| plan.interleave_offset(set)).collect();
                assert_eq!(offsets.len() as u32, plan.sets);
                for set in 0..plan.sets {
                    assert_eq!(plan.offset(set) % 256, 0);
                    let end = u64::from(plan.offset(set))
                        + u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES;
                    assert!(end <= plan.buffer_bytes());
                }
            }
        }
    }
}

//! Interleaving of a camera's VPLs among its pixels: plain arithmetic, no renderer.

use bytemuck::{Pod, Zeroable};

use crate::gi::settings::{FrugalGi, GiInterleave};

/// Bytes of `vpl/vpl.wgsl`'s `Vpl`. A test compares it with the shader.
pub(in crate::gi) const VPL_BYTES: u64 = 48;
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
        Self { interleave: side, sets, per_set, sequence: 0 }
    }

    /// The same without VPLs, where there are no texels to sample.
    #[must_use]
    pub(crate) fn without_vpls(self) -> Self {
        Self { per_set: 0, ..self }
    }

    /// VPLs in the buffer: one set behind the other.
    pub(crate) fn count(&self) -> u32 {
        self.sets * self.per_set
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

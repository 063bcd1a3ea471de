//! Settings: one level per knob, packed into an integer.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Bits per knob in [`KnobLevels`].
const BITS: u32 = 4;

/// One level per knob of a [`KnobSpace`](super::KnobSpace), four bits each, with the space's first
/// knob in the lowest bits. Higher levels give higher quality, usually at a higher cost.
///
/// Wang et al. 2016, section 3.7.2, use the same packing in 32 bits.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Reflect,
    Serialize,
    Deserialize,
)]
#[serde(transparent)]
pub struct KnobLevels(u64);

impl KnobLevels {
    /// Maximum number of knobs of a space.
    pub const MAX_KNOBS: usize = (u64::BITS / BITS) as usize;
    /// Maximum number of levels of a knob.
    pub const MAX_LEVELS: usize = 1 << BITS;

    /// The settings of the packed form `bits`. Any value is accepted;
    /// [`KnobSpace::contains`](super::KnobSpace::contains) checks it.
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// The packed form.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Level of the space's `knob`-th knob, 0 to 15, for `knob` from 0 to 15.
    pub const fn level(self, knob: usize) -> usize {
        ((self.0 >> (knob as u32 * BITS)) & (Self::MAX_LEVELS as u64 - 1)) as usize
    }

    /// These settings with the `knob`-th knob, 0 to 15, at `level`. Panics if `level` is not below
    /// [`MAX_LEVELS`](Self::MAX_LEVELS).
    #[must_use]
    pub const fn with_level(self, knob: usize, level: usize) -> Self {
        assert!(level < Self::MAX_LEVELS, "a level takes four bits");
        let shift = knob as u32 * BITS;
        let mask = (Self::MAX_LEVELS as u64 - 1) << shift;
        Self((self.0 & !mask) | ((level as u64) << shift))
    }
}

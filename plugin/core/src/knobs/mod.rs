//! Quality knobs: the available knobs ([`KnobSpace`]) and one level for each ([`KnobLevels`]).

mod space;

use serde::{Deserialize, Serialize, Serializer};

pub use space::{KnobSpace, KnobSpaceError, did_you_mean};

/// One level of a knob.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub struct Level {
    /// The level's value, in the knob's own unit (samples, texels, a share of pixels…); finite,
    /// increasing with quality.
    pub value: f64,
    /// Label of the level on the command line, in files and in reports. Should be unique in its
    /// knob.
    pub label: String,
}

/// Condition under which a knob has an effect: another knob at a minimum level.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub struct DependsOn {
    /// Name of the other knob.
    pub knob: String,
    /// Minimum level of the other knob, as an index.
    pub at_least: usize,
}

/// A quality knob: a rendering parameter that trades quality for power.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
pub struct Knob {
    /// Identifier in snake case, unique in its space; used on the command line and in files.
    pub name: String,
    /// Levels in order of increasing quality, usually cheapest first; 1 to
    /// [`KnobLevels::MAX_LEVELS`].
    pub levels: Vec<Level>,
    /// Dependency on another knob. Unless it is met, all levels of this knob give the same image at
    /// the same cost.
    pub needs: Option<DependsOn>,
}

impl Knob {
    /// A knob with its values as labels. [`KnobSpace::new`] checks the
    /// levels.
    pub fn new(name: &str, levels: impl IntoIterator<Item = f64>) -> Self {
        Self::labelled(name, levels.into_iter().map(|value| (value, value.to_string())))
    }

    /// A knob with a label per level. [`KnobSpace::new`] checks the levels.
    pub fn labelled<L: Into<String>>(
        name: &str,
        levels: impl IntoIterator<Item = (f64, L)>,
    ) -> Self {
        let levels =
            levels.into_iter().map(|(value, label)| Level { value, label: label.into() }).collect();
        Self { name: name.to_owned(), levels, needs: None }
    }

    /// The same knob, with an effect only while `knob` is at level `at_least` or above.
    #[must_use]
    pub fn needing(mut self, knob: &str, at_least: usize) -> Self {
        self.needs = Some(DependsOn { knob: knob.to_owned(), at_least });
        self
    }
}

/// Bits per knob in [`KnobLevels`].
const BITS: u32 = 4;

/// One level per knob of a [`KnobSpace`], four bits each, with the space's first
/// knob in the lowest bits. Higher levels give higher quality, usually at a higher cost.
///
/// Wang et al. 2016, section 3.7.2, use the same packing in 32 bits.
///
/// Files hold an integer, or from a 17th knob on, which needs more than 64 bits, a hexadecimal
/// string such as `"0x10000000000000000"`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect))]
#[serde(try_from = "Stored")]
pub struct KnobLevels(u128);

impl KnobLevels {
    /// Maximum number of knobs of a space.
    pub const MAX_KNOBS: usize = (u128::BITS / BITS) as usize;
    /// Maximum number of levels of a knob.
    pub const MAX_LEVELS: usize = 1 << BITS;

    /// The settings of the packed form `bits`. Any value is accepted;
    /// [`KnobSpace::contains`] checks it.
    pub const fn from_bits(bits: u128) -> Self {
        Self(bits)
    }

    /// The packed form.
    pub const fn bits(self) -> u128 {
        self.0
    }

    /// Level of the space's `knob`-th knob, 0 to 15, for `knob` from 0 to 31.
    pub const fn level(self, knob: usize) -> usize {
        ((self.0 >> (knob as u32 * BITS)) & (Self::MAX_LEVELS as u128 - 1)) as usize
    }

    /// These settings with the `knob`-th knob, 0 to 31, at `level`. Panics if `level` is not below
    /// [`MAX_LEVELS`](Self::MAX_LEVELS).
    #[must_use]
    pub const fn with_level(self, knob: usize, level: usize) -> Self {
        assert!(level < Self::MAX_LEVELS, "a level takes four bits");
        let shift = knob as u32 * BITS;
        let mask = (Self::MAX_LEVELS as u128 - 1) << shift;
        Self((self.0 & !mask) | ((level as u128) << shift))
    }
}

impl Serialize for KnobLevels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match u64::try_from(self.0) {
            Ok(bits) => serializer.serialize_u64(bits),
            Err(_) => serializer.collect_str(&format_args!("{:#x}", self.0)),
        }
    }
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "settings must be an integer of 0 or more, or hexadecimal digits after 0x in quotes"
)]
enum Stored {
    Number(u64),
    Text(String),
}

impl TryFrom<Stored> for KnobLevels {
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        let text = match stored {
            Stored::Number(bits) => return Ok(Self(bits.into())),
            Stored::Text(text) => text,
        };
        let bits = text.strip_prefix("0x").and_then(|digits| u128::from_str_radix(digits, 16).ok());
        bits.map(Self)
            .ok_or_else(|| format!("settings \"{text}\" are no hexadecimal digits after 0x"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_knob_has_its_own_bits() {
        let last = KnobLevels::MAX_KNOBS - 1;
        assert_eq!(last, 31);
        for knob in 0..=last {
            let settings = KnobLevels::default().with_level(knob, 15);
            assert!(
                (0..=last).all(|other| settings.level(other) == if other == knob { 15 } else { 0 })
            );
            assert_eq!(settings.with_level(knob, 0), KnobLevels::default());
        }
    }

    #[test]
    fn settings_of_many_knobs_survive_a_file() {
        for bits in [0, 7, u128::from(u64::MAX), u128::from(u64::MAX) + 1, u128::MAX] {
            let settings = KnobLevels::from_bits(bits);
            let text = ron::to_string(&settings).unwrap();
            assert_eq!(ron::from_str::<KnobLevels>(&text), Ok(settings), "{text}");
        }
        assert_eq!(
            ron::to_string(&KnobLevels::from_bits(1 << 64)).unwrap(),
            "\"0x10000000000000000\""
        );
        for wrong in [
            "-1",
            "1.5",
            "\"\"",
            "\"0x\"",
            "\"12\"",
            "\"0x100000000000000000000000000000000\"",
            "[]",
        ] {
            assert!(ron::from_str::<KnobLevels>(wrong).is_err(), "{wrong}");
        }
    }
}

//! A knob: its name, its levels, and the knob that it depends on.

#[cfg(feature = "bevy")]
use bevy_reflect::Reflect;
use serde::{Deserialize, Serialize};

/// One level of a knob.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
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
#[cfg_attr(feature = "bevy", derive(Reflect))]
pub struct DependsOn {
    /// Name of the other knob.
    pub knob: String,
    /// Minimum level of the other knob, as an index.
    pub at_least: usize,
}

/// A quality knob: a rendering parameter that trades quality for power.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(Reflect))]
pub struct Knob {
    /// Identifier in snake case, unique in its space; used on the command line and in files.
    pub name: String,
    /// Levels in order of increasing quality, usually cheapest first; 1 to
    /// [`KnobLevels::MAX_LEVELS`](super::KnobLevels::MAX_LEVELS).
    pub levels: Vec<Level>,
    /// Dependency on another knob. Unless it is met, all levels of this knob give the same image at
    /// the same cost.
    pub needs: Option<DependsOn>,
}

impl Knob {
    /// A knob with its values as labels. [`KnobSpace::new`](super::KnobSpace::new) checks the
    /// levels.
    pub fn new(name: &str, levels: impl IntoIterator<Item = f64>) -> Self {
        Self::labelled(name, levels.into_iter().map(|value| (value, value.to_string())))
    }

    /// A knob with a label per level. [`KnobSpace::new`](super::KnobSpace::new) checks the levels.
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

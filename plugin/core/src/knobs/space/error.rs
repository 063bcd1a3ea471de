//! Why a list of knobs is not a valid space, or a text not valid settings.

use super::SEPARATOR;
use crate::knobs::KnobLevels;

/// Why a list of knobs is not a valid space, or a text not valid settings.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KnobSpaceError {
    /// More knobs than [`KnobLevels`] can pack.
    #[error("{0} knobs, but settings pack at most {max}: leave some out", max = KnobLevels::MAX_KNOBS)]
    TooManyKnobs(usize),
    /// No level, too many levels, or a value that is not finite.
    #[error("knob `{0}` must have 1 to {max} levels with finite values", max = KnobLevels::MAX_LEVELS)]
    BadLevels(String),
    /// Two knobs with the same name.
    #[error("knob `{0}` appears twice")]
    Duplicate(String),
    /// A name that is not a knob of the space.
    #[error("unknown knob `{name}`: {}the knobs here are {known}", did_you_mean(name, known.split(SEPARATOR)))]
    Unknown {
        /// The name as given.
        name: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// A label that is not a level of the knob.
    #[error("knob `{knob}` has no level `{level}`: {}its levels are {known}", did_you_mean(level, known.split(SEPARATOR)))]
    UnknownLevel {
        /// The knob.
        knob: String,
        /// The level as given.
        level: String,
        /// The valid names, separated by commas.
        known: String,
    },
    /// Text other than `knob=level`, `max` or `min`.
    #[error("`{0}` is not of the form knob=level, nor one of `max` and `min`")]
    NotAnAssignment(String),
}

/// "did you mean `X`? " with the name of `known` that is nearest to `name`; empty where none is near.
///
/// Near is an edit distance (Damerau and Levenshtein, restricted) of at most a third of the letters,
/// regardless of case. A fixed distance would suggest any short name for any other.
pub fn did_you_mean<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let lower = name.to_lowercase();
    let near = known.into_iter().filter_map(|known| {
        let longer = name.chars().count().max(known.chars().count());
        let distance = strsim::osa_distance(&lower, &known.to_lowercase());
        (distance <= longer / 3).then_some((distance, known))
    });
    // The first of equally near ones.
    let nearest = near.min_by_key(|(distance, _)| *distance);
    nearest.map(|(_, known)| format!("did you mean `{known}`? ")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [&str; 5] = ["gi_visibility", "antialiasing", "FXAA", "off", "4x4"];

    #[test]
    fn one_misspelling_in_three_letters_is_recognised() {
        for (name, known) in [
            ("gi_visibilty", "gi_visibility"),
            ("GI-Visibility", "gi_visibility"),
            ("anti_aliasing", "antialiasing"),
            ("fxaa", "FXAA"),
            ("of", "off"),
            ("4×4", "4x4"),
        ] {
            assert_eq!(did_you_mean(name, KNOWN), format!("did you mean `{known}`? "), "{name}");
        }
    }

    #[test]
    fn another_word_is_not_a_misspelling() {
        for name in ["", "sharpness", "MSAA", "on", "8x8", "gi_bounces", &"x".repeat(10_000)] {
            assert_eq!(did_you_mean(name, KNOWN), "", "{name}");
        }
        assert_eq!(did_you_mean("off", []), "");
    }

    #[test]
    fn the_nearest_comes_first_and_ties_keep_their_order() {
        assert_eq!(did_you_mean("shadow", ["shadows", "shadow_"]), "did you mean `shadows`? ");
        assert_eq!(
            did_you_mean("shadow_cascade", ["shadow_cast", "shadow_cascades"]),
            "did you mean `shadow_cascades`? "
        );
    }
}

//! Suggestions for misspelt names in error messages.

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

//! Analysis of finished maps: power of two maps at equal error, and presets for a settings menu.
//! Renders nothing.
//!
//! | item | job |
//! |---|---|
//! | [`compare`], [`MapComparison`] | power at equal error, old against new: an energy gate |
//! | [`presets`], [`Presets`] | battery, low, medium, high and ultra, from the shared frontier |
//! | [`comparison_table`], [`presets_table`] | both as text |

mod comparable;
mod compare;
mod presets;
#[cfg(test)]
pub(crate) mod testing;

use std::fmt::Write as _;

use compare::Change;
pub(crate) use compare::{MapComparison, compare};
pub(crate) use presets::{Presets, presets};

/// `comparison` as plain text; every line ends with a line break.
pub(crate) fn comparison_table(comparison: &MapComparison) -> String {
    let mut text = String::from("power at equal error");
    let [old, new] = comparison.idle_w;
    if old == new && old > 0.0 {
        let _ = write!(text, ", beyond the {old:.3} W of the idle device");
    } else if old != new {
        let _ = write!(text, ", beyond the {old:.3} W and {new:.3} W of the idle device");
    }
    let heads = ["old W", "new W", "change"].map(|head| format!("{head:>9}")).concat();
    let _ = write!(text, "\n{:6}{:>27}{:>27}\n", "", "shared frontier", "mean over addresses");
    let _ = writeln!(text, "{:6}{heads}{heads}  addresses", "error");
    for level in &comparison.errors {
        let addresses = level.addresses.map_or(0, |change| change.frontiers);
        let _ = writeln!(
            text,
            "{:<6}{}{}{addresses:>11}",
            level.error,
            columns(level.shared),
            columns(level.addresses)
        );
    }
    let mean = |change: Option<f64>| change.map_or_else(|| "-".to_owned(), percent);
    let _ = writeln!(
        text,
        "{:6}{:>27}{:>27}",
        "mean",
        mean(comparison.shared_change),
        mean(comparison.addresses_change)
    );
    text
}

fn columns(change: Option<Change>) -> String {
    let columns = change.map_or_else(
        || ["-"; 3].map(str::to_owned),
        |change| {
            [format!("{:.3}", change.old_w), format!("{:.3}", change.new_w), percent(change.change)]
        },
    );
    columns.map(|column| format!("{column:>9}")).concat()
}

fn percent(share: f64) -> String {
    format!("{:+.2} %", 100.0 * share)
}

/// Name, power and error of each preset.
pub(crate) fn presets_table(presets: &Presets) -> String {
    let mut text = format!("{:8}{:>9}{:>9}\n", "preset", "W", "error");
    for preset in &presets.presets {
        let _ = writeln!(text, "{:8}{:>9.3}{:>9.4}", preset.name, preset.power_w, preset.error);
    }
    text
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::Frontier;

    use super::testing::{map, with_power};
    use super::*;

    #[test]
    fn a_table_has_a_line_for_each_error() {
        let mut old = map();
        old.shared = Frontier::default();
        let text =
            comparison_table(&compare(&old, &with_power(&map(), 1.02), false).expect("comparable"));
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 10, "{text}");
        assert!(
            lines[3].starts_with("0.005")
                && lines[3].ends_with("48")
                && lines[3].contains("+2.00 %"),
            "{text}"
        );
        assert!(
            lines[9].starts_with("mean")
                && lines[9].ends_with("+2.00 %")
                && lines[9].contains(" - "),
            "{text}"
        );
        let widths: Vec<_> = lines[2..9].iter().map(|line| line.chars().count()).collect();
        assert!(widths.iter().all(|width| *width == widths[0]), "{text}");
    }

    #[test]
    fn presets_are_a_line_each() {
        let text = presets_table(&presets(&map()).expect("presets"));
        assert_eq!(text.lines().count(), 6, "{text}");
        assert!(
            text.lines()
                .nth(5)
                .is_some_and(|line| line.starts_with("ultra") && line.ends_with("0.0000")),
            "{text}"
        );
    }
}

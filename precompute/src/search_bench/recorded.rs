//! A recorded table, and those of other cameras, in one knob space.

use std::collections::BTreeMap;

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::{DependsOn, Knob, KnobLevels, KnobSpace};

use crate::cost::FrameLayout;
use crate::table::{ASSUMED_LAYOUT, CostTable, SweepTable};

/// Why tables cannot be used together, or for the requested errors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum RecordedError {
    /// The knobs or levels of the tables differ.
    #[error(
        "its knobs are {here}, those of the searched table {there}: sweep both with the same `--knobs`"
    )]
    OtherKnobs {
        /// The other table's value.
        here: String,
        /// The searched table's value.
        there: String,
    },
    /// The conditions of the tables differ.
    #[error(
        "its {what} is {here}, that of the searched table {there}: sweep both under the same conditions"
    )]
    OtherConditions {
        /// The condition.
        what: &'static str,
        /// The other table's value.
        here: String,
        /// The searched table's value.
        there: String,
    },
    /// Another table equals the searched one.
    #[error("it holds the same readings as the searched table: give tables of other cameras")]
    SameReadings,
    /// No combination has as little error.
    #[error(
        "no combination has an error of at most {error}, the least is {least:.4}: ask for errors above it with `--errors`"
    )]
    NoneWithin {
        /// The requested error.
        error: f64,
        /// The least error of the table.
        least: f64,
    },
}

/// The searched table, and readings of other cameras. Its knobs have only the levels that occur in
/// the table.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    /// The knobs, with the levels that occur in the table.
    pub space: KnobSpace,
    /// Parameters of the work model other than settings.
    pub layout: FrameLayout,
    /// Cost of each combination of the table.
    pub costs: BTreeMap<KnobLevels, CostPoint>,
    /// Readings of other cameras, a row for each.
    pub others: CostTable,
}

impl Recorded {
    /// Searches `table`; `others` are tables of other cameras.
    ///
    /// # Errors
    /// The index of a table in `others` that does not fit, and the reason.
    pub(crate) fn new(
        table: &SweepTable,
        others: &[SweepTable],
    ) -> Result<Self, (usize, RecordedError)> {
        let levels = Levels::of(table);
        let space = levels.space();
        let mut known = CostTable::new(others.len());
        for (row, other) in others.iter().enumerate() {
            fits(table, other).map_err(|error| (row, error))?;
            for point in &other.points {
                if let Some(settings) = levels.settings(point.settings) {
                    known.set(row, space.canonical(settings), point.cost);
                }
            }
        }
        let point = |point: &FrontierPoint| {
            Some((space.canonical(levels.settings(point.settings)?), point.cost))
        };
        let costs = table.points.iter().filter_map(point).collect();
        Ok(Self {
            layout: table.facts.layout().unwrap_or(ASSUMED_LAYOUT),
            costs,
            others: known,
            space,
        })
    }

    /// The least power at an error of at most `error`.
    pub(crate) fn least_power(&self, error: f64) -> Option<f64> {
        self.costs
            .values()
            .filter(|cost| cost.error <= error)
            .map(|cost| cost.power.0)
            .min_by(f64::total_cmp)
    }

    /// The least error.
    pub(crate) fn least_error(&self) -> f64 {
        self.costs.values().map(|cost| cost.error).fold(f64::INFINITY, f64::min)
    }
}

/// Checks that `other` is comparable with `table`.
fn fits(table: &SweepTable, other: &SweepTable) -> Result<(), RecordedError> {
    let same = |a: &Knob, b: &Knob| {
        a.name == b.name && a.levels.iter().map(|l| &l.label).eq(b.levels.iter().map(|l| &l.label))
    };
    let (there, here) = (table.space.knobs(), other.space.knobs());
    if there.len() != here.len() || there.iter().zip(here).any(|(a, b)| !same(a, b)) {
        return Err(RecordedError::OtherKnobs { here: names(here), there: names(there) });
    }
    // The searched table itself would make the benchmark meaningless.
    if table.points == other.points {
        return Err(RecordedError::SameReadings);
    }
    let (there, here) = (&table.facts, &other.facts);
    alike("scene", &there.scene, &here.scene)?;
    alike("size", &there.size, &here.size)?;
    alike("frame rate", &there.frames_per_second, &here.frames_per_second)?;
    alike(
        "meter",
        &there.meter.as_ref().map(|meter| &meter.name),
        &here.meter.as_ref().map(|meter| &meter.name),
    )
}

/// Checks that values are equal where both files have them.
fn alike<T: PartialEq + std::fmt::Debug>(
    what: &'static str,
    there: &Option<T>,
    here: &Option<T>,
) -> Result<(), RecordedError> {
    match (there, here) {
        (Some(there), Some(here)) if there != here => Err(RecordedError::OtherConditions {
            what,
            here: format!("{here:?}"),
            there: format!("{there:?}"),
        }),
        _ => Ok(()),
    }
}

/// `knob (3 levels), …`
fn names(knobs: &[Knob]) -> String {
    knobs
        .iter()
        .map(|knob| format!("{} ({} levels)", knob.name, knob.levels.len()))
        .collect::<Vec<_>>()
        .join(", ")
}

/// Levels that occur in a table.
struct Levels<'a> {
    space: &'a KnobSpace,
    /// Levels by knob, ascending.
    occurring: Vec<Vec<usize>>,
}

impl<'a> Levels<'a> {
    fn of(table: &'a SweepTable) -> Self {
        let occurs = |knob: usize, level: usize| {
            table.points.iter().any(|point| point.settings.level(knob) == level)
        };
        let levels = |(knob, entry): (usize, &Knob)| {
            (0..entry.levels.len()).filter(|level| occurs(knob, *level)).collect()
        };
        Self {
            space: &table.space,
            occurring: table.space.knobs().iter().enumerate().map(levels).collect(),
        }
    }

    /// The space of these levels alone. A dependence on a level of another knob becomes one on the
    /// lowest remaining level at or above it.
    fn space(&self) -> KnobSpace {
        let knob = |(knob, levels): (&Knob, &Vec<usize>)| Knob {
            name: knob.name.clone(),
            levels: levels.iter().map(|level| knob.levels[*level].clone()).collect(),
            needs: knob
                .needs
                .as_ref()
                .map(|need| DependsOn { at_least: self.at_least(need), ..need.clone() }),
        };
        let knobs = self.space.knobs().iter().zip(&self.occurring).map(knob).collect();
        // Names and values are those of a valid space, and each knob has a level if there is a row.
        KnobSpace::new(knobs).unwrap_or_default()
    }

    fn at_least(&self, need: &DependsOn) -> usize {
        let levels = self.space.index_of(&need.knob).map(|knob| &self.occurring[knob]);
        levels
            .map_or(need.at_least, |levels| levels.partition_point(|level| *level < need.at_least))
    }

    /// Converts settings to the space of these levels; `None` where they have another level.
    fn settings(&self, settings: KnobLevels) -> Option<KnobLevels> {
        self.occurring.iter().enumerate().try_fold(KnobLevels::default(), |kept, (knob, levels)| {
            Some(kept.with_level(knob, levels.binary_search(&settings.level(knob)).ok()?))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::SweepFacts;

    fn space() -> KnobSpace {
        let knobs = vec![
            Knob::new("count", [0.0, 1.0, 2.0, 3.0]),
            Knob::new("rays", [0.0, 2.0, 8.0]).needing("count", 2),
            Knob::new("scale", [0.5, 1.0]),
        ];
        KnobSpace::new(knobs).expect("a valid space")
    }

    fn table(error: f64, keep: impl Fn(KnobLevels) -> bool) -> SweepTable {
        let point = |settings: KnobLevels| FrontierPoint {
            settings,
            cost: CostPoint::new(1.0 + settings.bits() as f64, error),
        };
        let points = space().iter().filter(|settings| keep(*settings)).map(point).collect();
        SweepTable { facts: SweepFacts::default(), space: space(), points }
    }

    #[test]
    fn the_space_has_the_levels_of_the_table_and_no_others() {
        // No count of 2, only the better scale.
        let part = table(0.1, |settings| settings.level(0) != 2 && settings.level(2) == 1);
        let recorded = Recorded::new(&part, &[table(0.2, |_| true)]).expect("the same knobs");
        assert_eq!(
            recorded.space.knobs().iter().map(|knob| knob.levels.len()).collect::<Vec<_>>(),
            [3, 3, 1]
        );
        // Rays still need the upper counts: the third of the three that remain.
        assert_eq!((recorded.space.combinations(), recorded.costs.len()), (5, 5));
        assert!(recorded.space.iter().all(|settings| recorded.costs.contains_key(&settings)));
        assert_eq!((recorded.others.rows(), recorded.others.settings().len()), (1, 5));
        for (settings, cost) in &recorded.costs {
            assert_eq!(
                recorded.others.get(0, *settings).map(|cost| cost.power),
                Some(cost.power),
                "the same settings elsewhere"
            );
        }
        assert_eq!(recorded.least_power(0.05), None);
    }

    #[test]
    fn tables_that_do_not_fit_are_refused() {
        let (whole, mut other) = (table(0.1, |_| true), table(0.2, |_| true));
        other.space = space().subset(["count", "rays"]).expect("a part");
        let error = Recorded::new(&whole, &[table(0.2, |_| true), other]).expect_err("other knobs");
        assert!(
            matches!(error, (1, RecordedError::OtherKnobs { .. }))
                && error.1.to_string().contains("scale (2 levels)"),
            "{error:?}"
        );
        assert!(matches!(
            Recorded::new(&whole, std::slice::from_ref(&whole)),
            Err((0, RecordedError::SameReadings))
        ));
        let facts = |fps| SweepFacts { frames_per_second: Some(fps), ..SweepFacts::default() };
        let [slow, fast] = [(15.0, 0.2), (30.0, 0.3)]
            .map(|(fps, error)| SweepTable { facts: facts(fps), ..table(error, |_| true) });
        let error = Recorded::new(&slow, &[whole, fast]).expect_err("another rate");
        assert_eq!(
            error.1.to_string(),
            "its frame rate is 30.0, that of the searched table 15.0: sweep both under the same conditions"
        );
    }
}

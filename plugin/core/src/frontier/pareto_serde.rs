//! Serialisation of a frontier: a list of `(settings, watts, error)`.
//!
//! Field names would make a map's file several times longer. Watts keep four significant digits and
//! errors six decimals: both are finer than any meter or image metric that fills a map (Wang et al.
//! 2016, section 3.7.1, quote ±5 % for theirs).

use serde::de::{Deserialize, Deserializer, Error as _};
use serde::ser::{Serialize, Serializer};

use super::{CostPoint, Frontier, FrontierPoint};
use crate::knobs::KnobLevels;

impl Frontier {
    /// The frontier as stored in a file: watts rounded to four significant digits, errors to six
    /// decimals. Points that rounding makes equal or dominated are dropped. Rounding is idempotent.
    #[must_use]
    pub fn rounded(&self) -> Self {
        Self::from_points(self.points().iter().map(|point| {
            // Formatting rounds correctly in decimal; multiplication and division by powers of ten
            // do not. Both texts always parse.
            let power = format!("{:.3e}", point.cost.power.0).parse().unwrap_or(point.cost.power.0);
            let error: f64 = format!("{:.6}", point.cost.error).parse().unwrap_or(point.cost.error);
            // Adding zero turns −0, which would print as such, into 0.
            FrontierPoint { settings: point.settings, cost: CostPoint::new(power, error + 0.0) }
        }))
    }
}

impl Serialize for Frontier {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let stored = |point: &FrontierPoint| (point.settings, point.cost.power, point.cost.error);
        serializer.collect_seq(self.rounded().points().iter().map(stored))
    }
}

impl<'de> Deserialize<'de> for Frontier {
    /// Rejects points that are not finite, or not in order of increasing power and decreasing
    /// error: this crate did not write such a file, and a silent repair would hide that.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let stored = Vec::<(KnobLevels, f64, f64)>::deserialize(deserializer)?;
        let point = |(settings, power, error)| FrontierPoint {
            settings,
            cost: CostPoint::new(power, error),
        };
        let points: Vec<FrontierPoint> = stored.into_iter().map(point).collect();
        if let Some(CostPoint { power, error }) =
            points.iter().map(|it| it.cost).find(|cost| !cost.is_finite())
        {
            return Err(D::Error::custom(format_args!(
                "a frontier point of {} W and error {error}: both must be finite",
                power.0
            )));
        }
        let falls = |two: &&[FrontierPoint]| {
            two[0].cost.power >= two[1].cost.power || two[0].cost.error <= two[1].cost.error
        };
        if let Some(CostPoint { power, error }) =
            points.windows(2).find(falls).map(|two| two[1].cost)
        {
            return Err(D::Error::custom(format_args!(
                "a frontier point of {} W and error {error} is dominated by the one before, or out of order",
                power.0
            )));
        }
        Ok(Self::from_points(points))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point(bits: u128, power: f64, error: f64) -> FrontierPoint {
        FrontierPoint { settings: KnobLevels::from_bits(bits), cost: CostPoint::new(power, error) }
    }

    #[test]
    fn points_are_short_tuples() {
        let frontier =
            Frontier::from_points([point(3, 7.123_449, 0.123_456_7), point(17, 1_234.56, 0.0)]);
        assert_eq!(ron::to_string(&frontier), Ok("[(3,7.123,0.123457),(17,1235.0,0.0)]".into()));
    }

    #[test]
    fn points_that_rounding_makes_equal_are_written_once() {
        let frontier = Frontier::from_points([
            point(1, 7.000_1, 0.2),
            point(2, 7.000_2, 0.1),
            point(3, 8.0, 0.099_999_9),
        ]);
        let text = ron::to_string(&frontier).expect("serialisable");
        assert_eq!(text, "[(2,7.0,0.1)]");
        assert_eq!(ron::from_str::<Frontier>(&text), Ok(frontier.rounded()));
    }

    #[test]
    fn invalid_frontiers_are_rejected() {
        for (bad, why) in [
            ("[(0,2.0,0.1),(1,1.0,0.2)]", "out of order"),
            ("[(0,1.0,0.1),(1,2.0,0.2)]", "dominated"),
            ("[(0,1.0,0.1),(1,1.0,0.1)]", "dominated"),
            ("[(0,NaN,0.1)]", "finite"),
            ("[(0,1.0,inf)]", "finite"),
            ("[(0,1.0)]", ""),
        ] {
            let error = ron::from_str::<Frontier>(bad).expect_err(bad).to_string();
            assert!(error.contains(why), "{bad}: {error}");
        }
    }

    proptest! {
        #[test]
        fn written_frontiers_are_read_back(costs in prop::collection::vec((0.0..500.0_f64, 0.0..2.0_f64), 0..40)) {
            let points = costs.iter().enumerate().map(|(bits, (power, error))| point(bits as u128, *power, *error));
            let frontier = Frontier::from_points(points);
            let text = ron::to_string(&frontier).expect("serialisable");
            let back: Frontier = ron::from_str(&text).expect("the written text");
            prop_assert_eq!(&back, &frontier.rounded());
            prop_assert_eq!(ron::to_string(&back), Ok(text));
            for (kept, original) in back.points().iter().filter_map(|p| Some((p, frontier.points().iter().find(|o| o.settings == p.settings)?))) {
                prop_assert!((kept.cost.power.0 - original.cost.power.0).abs() <= 0.000_501 * original.cost.power.0);
                prop_assert!((kept.cost.error - original.cost.error).abs() <= 0.000_000_501);
            }
        }
    }
}

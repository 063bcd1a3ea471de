//! How different two frontiers are (Wang et al. 2016, equations 3.4 to 3.7).

use bevy_frugal_gi::frontier::{CostPoint, Frontier};
use bevy_frugal_gi::units::Watts;

/// Distance between two frontiers, separately by both costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distance {
    /// Mean |Δp|, of both directions together (equation 3.5).
    pub power: Watts,
    /// Mean |Δe|, of both directions together (equation 3.4).
    pub error: f64,
}

impl std::ops::Add for Distance {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { power: self.power + other.power, error: self.error + other.error }
    }
}

/// Mean distance from the points of one frontier, projected to another camera, to their nearest points on that camera's frontier (equations 3.6, 3.7).
///
/// `projected` is what the first frontier's settings cost at the second camera; points that are not finite are left out. `None` where there is nothing
/// to compare. (The source divides the power's sum by the number of points on the other frontier, but sums over this one's: the mean is meant.)
///
/// The source does not say how watts weigh against error where it looks for the nearest point. Here each is divided by its range over both curves, so
/// that the two fill a unit square: the result then does not depend on the units, nor on the thresholds, and no axis can drown the other. An axis
/// without range is ignored. Of equally near points the cheapest is taken. The distances that are averaged are the unscaled ones.
pub fn half_distance(projected: &[CostPoint], frontier: &Frontier) -> Option<Distance> {
    let projected: Vec<CostPoint> = projected.iter().copied().filter(|cost| cost.is_finite()).collect();
    if projected.is_empty() || frontier.is_empty() {
        return None;
    }
    let both = || projected.iter().copied().chain(frontier.points().iter().map(|point| point.cost));
    let scale = [inverse_range(both().map(|cost| cost.power.0)), inverse_range(both().map(|cost| cost.error))];
    let difference = |a: CostPoint, b: CostPoint| [(a.power - b.power).0.abs(), (a.error - b.error).abs()];
    let mut sum = [0.0; 2];
    for cost in &projected {
        let squared = |[power, error]: [f64; 2]| (power * scale[0]).powi(2) + (error * scale[1]).powi(2);
        let differences = frontier.points().iter().map(|point| difference(*cost, point.cost));
        // The first of equals: `min_by` keeps it.
        let nearest = differences.min_by(|a, b| squared(*a).total_cmp(&squared(*b)))?;
        sum = [sum[0] + nearest[0], sum[1] + nearest[1]];
    }
    let count = projected.len() as f64;
    Some(Distance { power: Watts(sum[0] / count), error: sum[1] / count })
}

fn inverse_range(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if high > low { 1.0 / (high - low) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::frontier::FrontierPoint;
    use bevy_frugal_gi::knobs::RenderSettings;

    use super::*;

    fn frontier(costs: &[(f64, f64)]) -> Frontier {
        let point = |(bits, (power, error)): (usize, &(f64, f64))| FrontierPoint {
            settings: RenderSettings::from_bits(bits as u64),
            cost: CostPoint::new(*power, *error),
        };
        Frontier::from_points(costs.iter().enumerate().map(point))
    }

    fn close(distance: Option<Distance>, power: f64, error: f64) -> bool {
        distance.is_some_and(|d| (d.power.0 - power).abs() < 1e-12 && (d.error - error).abs() < 1e-12)
    }

    #[test]
    fn worked_by_hand() {
        let target = frontier(&[(2.0, 0.4), (4.0, 0.2), (6.0, 0.0)]);
        // Ranges over both: 2 to 7 W, 0 to 0.4. (3, 0.35): scaled squares 0.04 + 0.015625 to the first, 0.04 + 0.140625 to the second.
        // (7, 0.05): 0.04 + 0.015625 to the last, 0.36 + 0.140625 to the second.
        let projected = [CostPoint::new(3.0, 0.35), CostPoint::new(7.0, 0.05)];
        assert!(close(half_distance(&projected, &target), (1.0 + 1.0) / 2.0, (0.05 + 0.05) / 2.0));
        // Unscaled, watts alone would decide and (5.4, 0.19) would go to (6, 0); scaled, its nearest is (4, 0.2): 0.0625 * 1.96 = 0.1225 against
        // (0.6 / 4)² + (0.19 / 0.4)² = 0.248.
        let projected = [CostPoint::new(5.4, 0.19)];
        assert!(close(half_distance(&projected, &target), 1.4, 0.01));
    }

    #[test]
    fn neither_units_nor_degenerate_curves_matter() {
        let target = frontier(&[(2.0, 0.4), (4.0, 0.2), (6.0, 0.0)]);
        let milliwatts = frontier(&[(2000.0, 0.4), (4000.0, 0.2), (6000.0, 0.0)]);
        let there = [CostPoint::new(5.4, 0.19), CostPoint::new(2.5, 0.1)];
        let scaled = there.map(|cost| CostPoint::new(cost.power.0 * 1000.0, cost.error));
        let (one, other) = (half_distance(&there, &target).expect("known"), half_distance(&scaled, &milliwatts).expect("known"));
        assert!((one.power.0 * 1000.0 - other.power.0).abs() < 1e-9 && (one.error - other.error).abs() < 1e-12);
        let single = frontier(&[(3.0, 0.0)]);
        assert!(close(half_distance(&[CostPoint::new(3.0, 0.0)], &single), 0.0, 0.0));
        assert!(close(half_distance(&[CostPoint::new(5.0, 0.0)], &single), 2.0, 0.0));
        assert_eq!(half_distance(&[], &single), None);
        assert_eq!(half_distance(&[CostPoint::new(1.0, f64::NAN)], &single), None);
        assert_eq!(half_distance(&[CostPoint::new(1.0, 0.0)], &Frontier::default()), None);
    }
}

//! Which points of a frontier are measured for all of them.

use bevy_frugal_gi::frontier::FrontierPoint;

/// How far along the frontier each point is: 0 at the first, rising to at most 2, in shares of the ranges of power and error.
///
/// Shares, because watts and errors have no common unit: each range counts as much as the other.
pub(super) fn positions(points: &[FrontierPoint]) -> Vec<f64> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let share = |difference: f64, range: f64| if range.abs() > 0.0 { (difference / range).abs() } else { 0.0 };
    let (power, error) = (last.cost.power.0 - first.cost.power.0, last.cost.error - first.cost.error);
    let mut so_far = 0.0;
    let mut positions = vec![0.0];
    for pair in points.windows(2) {
        let step = share((pair[1].cost.power - pair[0].cost.power).0, power).hypot(share(pair[1].cost.error - pair[0].cost.error, error));
        so_far += step;
        positions.push(so_far);
    }
    positions
}

/// Indices of at most `most` points, rising: the first, the last, and those nearest to equal steps between them.
pub(super) fn anchors(positions: &[f64], most: usize) -> Vec<usize> {
    let Some(length) = positions.last() else { return Vec::new() };
    if positions.len() <= most {
        return (0..positions.len()).collect();
    }
    let steps = most.max(2) - 1;
    let nearest = |target: f64| {
        let distance = |index: &usize| (positions[*index] - target).abs();
        (0..positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
    };
    let mut anchors: Vec<usize> = (1..steps).map(|step| nearest(length * step as f64 / steps as f64)).collect();
    // By index, not by position: at the ends several points may lie at the same place.
    anchors.extend([0, positions.len() - 1]);
    anchors.sort_unstable();
    anchors.dedup();
    anchors
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::frontier::CostPoint;
    use bevy_frugal_gi::knobs::RenderSettings;

    use super::*;

    fn points(costs: &[(f64, f64)]) -> Vec<FrontierPoint> {
        let point =
            |(power, error): &(f64, f64)| FrontierPoint { settings: RenderSettings::default(), cost: CostPoint::new(*power, *error) };
        costs.iter().map(point).collect()
    }

    #[test]
    fn anchors_lie_at_equal_steps_between_both_ends() {
        // An L: down the error first, then along the power. Its middle is the bend.
        let bent = points(&[(1.0, 0.4), (1.0, 0.3), (1.0, 0.2), (1.0, 0.1), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0), (4.0, 0.0), (5.0, 0.0)]);
        let positions = positions(&bent);
        assert_eq!(anchors(&positions, 3), [0, 4, 8]);
        assert_eq!(anchors(&positions, 5), [0, 2, 4, 6, 8]);
        assert_eq!(anchors(&positions, 2), [0, 8]);
        assert_eq!(anchors(&positions, 99), (0..9).collect::<Vec<_>>());
    }

    #[test]
    fn few_points_and_points_on_one_spot_are_all_well() {
        assert!(anchors(&positions(&[]), 5).is_empty());
        assert_eq!(anchors(&positions(&points(&[(1.0, 0.0)])), 5), [0]);
        assert_eq!(anchors(&positions(&points(&[(1.0, 0.5), (2.0, 0.0)])), 2), [0, 1]);
        assert_eq!(anchors(&positions(&points(&[(1.0, 0.5); 6])), 3), [0, 5]);
    }
}

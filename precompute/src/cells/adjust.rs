//! A frontier with other costs.

use bevy_frugal_gi::frontier::{Correction, CostPoint, Frontier, FrontierPoint};
use bevy_frugal_gi::knobs::RenderSettings;
use bevy_frugal_gi::units::Watts;

/// Measured ÷ promised error, where both are raised by [`Correction::LEAST_ERROR`].
///
/// Errors below that look the same, and a ratio to a smaller one says nothing. Raised, the ratio is one of errors where errors are large, and where
/// they are small it is in effect a difference: a promise of 0 and a measurement of 0.001 make a ratio of 2, which adds 0.001.
pub(super) fn error_ratio(promised: f64, measured: f64) -> f64 {
    (measured + Correction::LEAST_ERROR) / (promised + Correction::LEAST_ERROR)
}

/// `points` with the costs that are known of some of them, as a frontier.
///
/// Between two known points what is known is interpolated along `positions`; beyond the outermost it stays. Power changes by a factor. Error changes
/// by a factor where it is less than promised and by an amount where it is more, and the amount goes to nothing at `best`: which has no
/// error, whatever its neighbours do and however noisy its reading was, since it is what errors are measured against. A factor above 1 would make much
/// of what is next to nothing, an amount below 0 nothing of what is something. Without anything known, costs stay. Points that become beaten are dropped.
pub(super) fn adjust(
    points: &[FrontierPoint],
    positions: &[f64],
    power: &[(usize, f64)],
    error: &[(usize, f64)],
    best: RenderSettings,
) -> Frontier {
    let promised = |index: usize| points[index].cost;
    let less = |(index, known): &(usize, f64)| (*index, (known / promised(*index).error.max(f64::MIN_POSITIVE)).min(1.0));
    let more = |(index, known): &(usize, f64)| (*index, (known - promised(*index).error).max(0.0));
    let watts: Vec<_> = power.iter().map(|(index, known)| (*index, known / promised(*index).power.0)).collect();
    let factors: Vec<_> = error.iter().map(less).collect();
    let mut amounts: Vec<_> = error.iter().map(more).collect();
    // Along promised errors: what is more in proportion stays so.
    let errors: Vec<f64> = points.iter().map(|point| -point.cost.error).collect();
    let best_point = points.iter().position(|point| point.settings == best);
    // What is known of errors never includes the best point's.
    amounts.extend(best_point.filter(|_| !error.is_empty()).map(|index| (index, 0.0)));
    amounts.sort_unstable_by_key(|(index, _)| *index);
    Frontier::from_points(points.iter().enumerate().map(|(index, point)| {
        let CostPoint { power: Watts(power), error } = point.cost;
        let error = (error * interpolate(positions, &factors, index).unwrap_or(1.0) + interpolate(&errors, &amounts, index).unwrap_or(0.0))
            .clamp(0.0, 1.0);
        let error = if point.settings == best { 0.0 } else { error };
        FrontierPoint {
            settings: point.settings,
            cost: CostPoint::new(power * interpolate(positions, &watts, index).unwrap_or(1.0), error),
        }
    }))
}

fn interpolate(positions: &[f64], known: &[(usize, f64)], index: usize) -> Option<f64> {
    let above = known.partition_point(|(anchor, _)| *anchor < index);
    match (above.checked_sub(1).map(|below| known[below]), known.get(above)) {
        (_, Some((anchor, value))) if *anchor == index => Some(*value),
        (Some((low, from)), Some((high, to))) => {
            let range = positions[*high] - positions[low];
            let share = if range > 0.0 { (positions[index] - positions[low]) / range } else { 0.5 };
            Some(from + share * (to - from))
        }
        (Some((_, value)), None) | (None, Some(&(_, value))) => Some(value),
        (None, None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEST: RenderSettings = RenderSettings::from_bits(9);

    fn points() -> Vec<FrontierPoint> {
        let costs = [(0, 1.0, 0.4), (1, 2.0, 0.2), (2, 3.0, 0.1), (9, 4.0, 0.0)];
        costs
            .map(|(bits, power, error)| FrontierPoint { settings: RenderSettings::from_bits(bits), cost: CostPoint::new(power, error) })
            .into()
    }

    fn costs(frontier: &Frontier) -> Vec<(u64, f64, f64)> {
        let rounded = |x: f64| (x * 1e6).round() / 1e6;
        frontier.points().iter().map(|p| (p.settings.bits(), rounded(p.cost.power.0), rounded(p.cost.error))).collect()
    }

    const POSITIONS: [f64; 4] = [0.0, 1.0, 2.0, 4.0];

    #[test]
    fn what_is_known_is_interpolated_between_anchors_and_held_beyond() {
        // Half as much again is drawn at the first point, twice as much at the last; the second has 0.1 more error than promised.
        let adjusted = adjust(&points(), &POSITIONS, &[(0, 1.5), (3, 8.0)], &[(1, 0.3)], BEST);
        assert_eq!(costs(&adjusted), [(0, 1.5, 0.5), (1, 3.25, 0.3), (2, 5.25, 0.15), (9, 8.0, 0.0)]);
        assert_eq!(adjust(&points(), &POSITIONS, &[], &[], BEST), Frontier::from_points(points()));
    }

    #[test]
    fn errors_shrink_in_proportion_and_grow_by_what_was_seen() {
        let smaller = adjust(&points(), &POSITIONS, &[], &[(1, 0.1)], BEST);
        assert_eq!(costs(&smaller), [(0, 1.0, 0.2), (1, 2.0, 0.1), (2, 3.0, 0.05), (9, 4.0, 0.0)]);
        // Next to nothing was promised and 0.05 found: the next point has no more than that.
        let mut nothing = points();
        nothing[1].cost.error = 0.0005;
        nothing[2].cost.error = 0.0004;
        let larger = adjust(&nothing, &POSITIONS, &[], &[(0, 0.4), (1, 0.0505)], BEST);
        assert_eq!(costs(&larger), [(0, 1.0, 0.4), (1, 2.0, 0.0505), (2, 3.0, 0.0404), (9, 4.0, 0.0)]);
    }

    #[test]
    fn beaten_points_go_and_errors_stay_in_range() {
        // The best settings turn out the cheapest of all.
        let adjusted = adjust(&points(), &POSITIONS, &[(2, 3.0), (3, 0.4)], &[], BEST);
        assert_eq!(costs(&adjusted), [(9, 0.4, 0.0)]);
        let adjusted = adjust(&points(), &POSITIONS, &[], &[(0, 1e6), (2, 1e-6)], BEST);
        assert!(adjusted.points().iter().all(|point| (0.0..=1.0).contains(&point.cost.error)), "{adjusted:?}");
        assert!(adjust(&[], &[], &[], &[], BEST).is_empty());
    }

    #[test]
    fn small_errors_are_compared_by_difference() {
        assert!((error_ratio(0.0, 0.001) - 2.0).abs() < 1e-12);
        assert!((error_ratio(0.1, 0.3) - 3.0).abs() < 0.03);
        assert_eq!(error_ratio(0.0, 0.0), 1.0);
    }
}

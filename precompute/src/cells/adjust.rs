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

/// `points` with their costs multiplied by ratios that are known at some of them, as a frontier.
///
/// Between two points with a ratio it is interpolated along `positions`; beyond the outermost it stays. Without any, costs stay. `best` has no
/// error, whatever its neighbours do and however noisy its reading was: it is what errors are measured against. Points that become beaten are dropped.
pub(super) fn adjust(
    points: &[FrontierPoint],
    positions: &[f64],
    power: &[(usize, f64)],
    error: &[(usize, f64)],
    best: RenderSettings,
) -> Frontier {
    Frontier::from_points(points.iter().enumerate().map(|(index, point)| {
        let CostPoint { power: Watts(watts), error: promised } = point.cost;
        // Written so that a ratio of 1 changes nothing, to the last bit.
        let more = (promised + Correction::LEAST_ERROR) * (interpolate(positions, error, index) - 1.0);
        let error = if point.settings == best { 0.0 } else { (promised + more).clamp(0.0, 1.0) };
        FrontierPoint { settings: point.settings, cost: CostPoint::new(watts * interpolate(positions, power, index), error) }
    }))
}

fn interpolate(positions: &[f64], ratios: &[(usize, f64)], index: usize) -> f64 {
    let above = ratios.partition_point(|(anchor, _)| *anchor < index);
    match (above.checked_sub(1).map(|below| ratios[below]), ratios.get(above)) {
        (_, Some((anchor, ratio))) if *anchor == index => *ratio,
        (Some((low, from)), Some((high, to))) => {
            let range = positions[*high] - positions[low];
            let share = if range > 0.0 { (positions[index] - positions[low]) / range } else { 0.5 };
            from + share * (to - from)
        }
        (Some((_, ratio)), None) | (None, Some(&(_, ratio))) => ratio,
        (None, None) => 1.0,
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
    fn ratios_are_interpolated_between_anchors_and_held_beyond() {
        let adjusted = adjust(&points(), &POSITIONS, &[(0, 1.0), (3, 2.0)], &[(1, 2.0)], BEST);
        assert_eq!(costs(&adjusted), [(0, 1.0, 0.801), (1, 2.5, 0.401), (2, 4.5, 0.201), (9, 8.0, 0.0)]);
        assert_eq!(adjust(&points(), &POSITIONS, &[], &[], BEST), Frontier::from_points(points()));
    }

    #[test]
    fn beaten_points_go_and_errors_stay_in_range() {
        // The best settings turn out the cheapest of all.
        let adjusted = adjust(&points(), &POSITIONS, &[(2, 1.0), (3, 0.1)], &[], BEST);
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

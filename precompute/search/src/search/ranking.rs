//! Ranking of costs: non-dominated fronts and crowding distances (Deb, Pratap, Agarwal, Meyarivan
//! 2002, "A fast and elitist multiobjective genetic algorithm: NSGA-II", section III).

use std::cmp::Ordering;
use std::collections::HashSet;

use frugal_core::frontier::{CostPoint, FrontierPoint};

/// Indices into `costs` by front: the first is non-dominated, the second is dominated only by the
/// first, and so on. Within a front, ascending.
///
/// Costs must be finite: NaN is not dominated by anything and would be in the first front.
fn fronts(costs: &[CostPoint]) -> Vec<Vec<usize>> {
    let mut left: Vec<usize> = (0..costs.len()).collect();
    let mut sorted = Vec::new();
    while !left.is_empty() {
        let is_dominated =
            |one: &usize| left.iter().any(|other| costs[*other].dominates(costs[*one]));
        let (worse, front) = left.iter().copied().partition(is_dominated);
        sorted.push(front);
        left = worse;
    }
    sorted
}

/// For each member of `front`, half the perimeter of the box between its neighbours, both costs
/// scaled to the front's range. Infinite at the ends.
fn crowding_distances(costs: &[CostPoint], front: &[usize]) -> Vec<f64> {
    let mut distances = vec![0.0; front.len()];
    let measures: [fn(&CostPoint) -> f64; 2] = [|cost| cost.power.0, |cost| cost.error];
    for measure in measures {
        let value = |rank: usize| measure(&costs[front[rank]]);
        let mut order: Vec<usize> = (0..front.len()).collect();
        order.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
        let (Some(first), Some(last)) = (order.first().copied(), order.last().copied()) else {
            return distances;
        };
        let range = value(last) - value(first);
        distances[first] = f64::INFINITY;
        distances[last] = f64::INFINITY;
        if range > 0.0 {
            for three in order.windows(3) {
                distances[three[1]] += (value(three[2]) - value(three[0])) / range;
            }
        }
    }
    distances
}

/// Fitness of a point: its front's number (0 is best), and its crowding distance (larger is better).
pub(super) type Fitness = (usize, f64);

/// The crowded-comparison operator: `Less` is fitter.
pub(super) fn compare(one: Fitness, other: Fitness) -> Ordering {
    one.0.cmp(&other.0).then(other.1.total_cmp(&one.1))
}

/// The fitness of every point among the others.
pub(super) fn fitness(points: &[FrontierPoint]) -> Vec<Fitness> {
    let costs: Vec<CostPoint> = points.iter().map(|point| point.cost).collect();
    let mut fitness = vec![(0, 0.0); points.len()];
    for (rank, front) in fronts(&costs).iter().enumerate() {
        for (index, crowding) in front.iter().zip(crowding_distances(&costs, front)) {
            fitness[*index] = (rank, crowding);
        }
    }
    fitness
}

/// The fittest `capacity` of `points`.
///
/// Of points with equal costs all but the first rank last: a knob without effect makes clones,
/// which would fill the first front by crowding distance alone. The paper has continuous variables
/// and no such clones.
pub(super) fn survivors(points: Vec<FrontierPoint>, capacity: usize) -> Vec<FrontierPoint> {
    let mut costs = HashSet::new();
    let (mut unique, mut clones): (Vec<_>, Vec<_>) = points.into_iter().partition(|point| {
        costs.insert((point.cost.power.0.to_bits(), point.cost.error.to_bits()))
    });
    let fitness = fitness(&unique);
    let mut order: Vec<usize> = (0..unique.len()).collect();
    order.sort_by(|a, b| compare(fitness[*a], fitness[*b]));
    unique = order.into_iter().map(|index| unique[index]).collect();
    unique.append(&mut clones);
    unique.truncate(capacity);
    unique
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::KnobLevels;

    use super::*;

    #[test]
    fn points_fall_into_their_fronts() {
        let costs =
            [(1.0, 4.0), (2.0, 2.0), (4.0, 1.0), (2.0, 4.0), (3.0, 3.0), (4.0, 4.0), (1.0, 4.0)];
        let costs: Vec<_> =
            costs.into_iter().map(|(power, error)| CostPoint::new(power, error)).collect();
        // Equal costs do not dominate one another: 0 and 6 share a front. 3 is dominated by 0 and 1
        // only, 4 by 1 only, 5 by both of those.
        assert_eq!(fronts(&costs), [vec![0, 1, 2, 6], vec![3, 4], vec![5]]);
        assert!(fronts(&[]).is_empty());
    }

    #[test]
    fn distances_are_the_scaled_differences_between_neighbours() {
        let costs = [(0.0, 1.0), (1.0, 0.6), (4.0, 0.2), (5.0, 0.0)]
            .map(|(power, error)| CostPoint::new(power, error));
        let distances = crowding_distances(&costs, &[0, 1, 2, 3]);
        assert!(distances[0].is_infinite() && distances[3].is_infinite());
        // (4 - 0) / 5 + (1 - 0.2) / 1 and (5 - 1) / 5 + (0.6 - 0) / 1.
        assert!(
            (distances[1] - 1.6).abs() < 1e-12 && (distances[2] - 1.4).abs() < 1e-12,
            "{distances:?}"
        );
        assert!(crowding_distances(&costs, &[]).is_empty());
    }

    #[test]
    fn the_crowded_and_the_cloned_go_first() {
        let point = |bits, power, error| FrontierPoint {
            settings: KnobLevels::from_bits(bits),
            cost: CostPoint::new(power, error),
        };
        let points = vec![
            point(0, 0.0, 1.0),
            point(1, 0.0, 1.0), // a clone of the first
            point(2, 0.1, 0.9), // crowded
            point(3, 0.5, 0.5),
            point(4, 1.0, 0.0),
            point(5, 1.0, 1.0), // dominated
        ];
        let kept = |capacity| {
            survivors(points.clone(), capacity)
                .iter()
                .map(|point| point.settings.bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(kept(3), [0, 4, 3]);
        assert_eq!(kept(5), [0, 4, 3, 2, 5]);
        assert_eq!(kept(9).len(), 6);
    }
}

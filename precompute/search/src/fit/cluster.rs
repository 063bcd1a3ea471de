//! A bounded number of frontiers: similar estimates share one.
//!
//! Most corners of the octree have no camera of their own, and their estimates differ by less than
//! a map can be trusted.

use frugal_core::frontier::CostPoint;

use super::training::Estimate;
use crate::pool::LEAST_ERROR;

/// Assigns each of `estimates` to one of at most `most` clusters. Returns the cluster of each, and
/// the mean estimate of each cluster, weighted by evidence. Estimates closer than `least` to a
/// centre never open another.
pub(super) fn cluster(
    estimates: &[Estimate],
    most: usize,
    least: f64,
) -> (Vec<usize>, Vec<Estimate>) {
    let (centres, assigned) =
        farthest(estimates.len(), most, least, |a, b| distance(&estimates[a], &estimates[b]));
    let means = (0..centres.len())
        .map(|centre| {
            mean(estimates.iter().zip(&assigned).filter(|(_, of)| **of == centre).map(|(e, _)| e))
        })
        .collect();
    (assigned, means)
}

/// Mean over settings of the differences in the logarithms of power and error.
fn distance(a: &Estimate, b: &Estimate) -> f64 {
    let ratio = |a: f64, b: f64| (a.max(1e-9) / b.max(1e-9)).ln().abs();
    let sum: f64 = a
        .costs
        .iter()
        .zip(&b.costs)
        .map(|(a, b)| {
            ratio(a.power.0, b.power.0) + ratio(a.error + LEAST_ERROR, b.error + LEAST_ERROR)
        })
        .sum();
    sum / a.costs.len().max(1) as f64
}

fn mean<'a>(estimates: impl Iterator<Item = &'a Estimate>) -> Estimate {
    // No estimate is without influence.
    let all: Vec<(f64, &Estimate)> =
        estimates.map(|estimate| (estimate.weight.max(1e-3), estimate)).collect();
    let weight: f64 = all.iter().map(|(share, _)| share).sum();
    let mean = |setting: usize| {
        let of = |value: fn(&CostPoint) -> f64| {
            all.iter().map(|(share, of)| share * value(&of.costs[setting])).sum::<f64>() / weight
        };
        CostPoint::new(of(|cost| cost.power.0), of(|cost| cost.error))
    };
    let settings = all.first().map_or(0, |(_, estimate)| estimate.costs.len());
    Estimate { costs: (0..settings).map(mean).collect(), weight }
}

/// Farthest-point selection (Gonzalez 1985): a few of many, far apart. At most doubles the greatest
/// distance of the best choice.
///
/// Chooses at most `most` of `count` elements, beginning with the first; each is the farthest from
/// those before it, and farther than `least` from all of them. NaN counts as no distance. Ties go
/// to the first, so that the result is the same everywhere. Returns their numbers, in the order of
/// choice, and for each element the place there of the nearest one; of a chosen one its own.
fn farthest(
    count: usize,
    most: usize,
    least: f64,
    distance: impl Fn(usize, usize) -> f64,
) -> (Vec<usize>, Vec<usize>) {
    let mut nearest = vec![(f64::INFINITY, 0); count];
    let mut chosen = Vec::new();
    while chosen.len() < most {
        let far = |a: &usize, b: &usize| nearest[*a].0.total_cmp(&nearest[*b].0).then(b.cmp(a));
        let Some(next) = (0..count).max_by(far).filter(|next| nearest[*next].0 > least) else {
            break;
        };
        for (other, nearest) in nearest.iter_mut().enumerate() {
            let distance = distance(next, other);
            if distance < nearest.0 {
                *nearest = (distance, chosen.len());
            }
        }
        // Never chosen again, and its own nearest.
        nearest[next] = (f64::NEG_INFINITY, chosen.len());
        chosen.push(next);
    }
    (chosen, nearest.into_iter().map(|(_, place)| place).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(errors: [f64; 2], weight: f64) -> Estimate {
        Estimate { costs: errors.map(|error| CostPoint::new(2.0, error)).to_vec(), weight }
    }

    #[test]
    fn similar_estimates_share_a_mean_weighted_by_evidence() {
        let all = [
            estimate([0.01, 0.1], 3.0),
            estimate([0.5, 0.02], 1.0),
            estimate([0.014, 0.1], 1.0),
            estimate([0.5, 0.02], 0.0),
        ];
        let (assigned, means) = cluster(&all, 2, 0.0);
        assert_eq!(assigned, [0, 1, 0, 1]);
        assert_eq!((means.len(), means[0].weight), (2, 4.0));
        assert!((means[0].costs[0].error - 0.011).abs() < 1e-12);
        assert!((means[1].costs[1].error - 0.02).abs() < 1e-12 && means[1].costs[0].power.0 == 2.0);
    }

    #[test]
    fn there_are_no_more_clusters_than_asked_for_or_needed() {
        let all: Vec<Estimate> =
            (0..50).map(|step| estimate([0.001 * f64::from(step), 0.1], 1.0)).collect();
        for most in [1, 7, 50, 90] {
            let (assigned, means) = cluster(&all, most, 0.0);
            assert_eq!(means.len(), most.min(50));
            assert!(assigned.iter().all(|of| *of < means.len()));
        }
        assert_eq!(cluster(&all, 50, 10.0).1.len(), 1, "all within the least distance");
        assert_eq!(cluster(&[], 5, 0.0), (vec![], vec![]));
        let odd = [estimate([f64::NAN, 0.1], 1.0), estimate([0.1, 0.1], 1.0)];
        assert_eq!(cluster(&odd, 5, 0.0).0.len(), 2, "invalid estimates do not panic");
    }

    #[test]
    fn each_is_the_farthest_from_those_before_it() {
        let at = [0.0_f64, 1.0, 10.0, 4.0, 10.0];
        let apart = |a: usize, b: usize| (at[a] - at[b]).abs();
        let all = farthest(at.len(), 9, f64::NEG_INFINITY, apart);
        assert_eq!(all.0, [0, 2, 3, 1, 4], "equal elements too");
        let few = farthest(at.len(), 3, 0.0, apart);
        assert_eq!(few, (vec![0, 2, 3], vec![0, 0, 1, 2, 1]));
        assert_eq!(farthest(at.len(), 9, 5.0, apart).0, [0, 2]);
        assert!(farthest(0, 3, 0.0, apart).0.is_empty());
        assert_eq!(farthest(3, 9, 0.0, |_, _| f64::NAN).0, [0, 1, 2]);
    }
}

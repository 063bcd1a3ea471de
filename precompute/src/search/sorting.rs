//! Fast non-dominated sort (Deb et al. 2002, "A fast and elitist multiobjective genetic algorithm:
//! NSGA-II", section III-A).

use bevy_frugal_gi::frontier::CostPoint;

/// Indices into `costs` by front: the first is non-dominated, the second is dominated only by the
/// first, and so on. Within a front, ascending.
///
/// O(n²) comparisons, as in the paper; populations are tens. Costs must be finite: NaN is not
/// dominated by anything and would be in the first front.
pub(crate) fn fronts(costs: &[CostPoint]) -> Vec<Vec<usize>> {
    let mut dominated = vec![Vec::new(); costs.len()];
    let mut dominated_by = vec![0_usize; costs.len()];
    for (a, one) in costs.iter().enumerate() {
        for (b, other) in costs.iter().enumerate() {
            if one.dominates(*other) {
                dominated[a].push(b);
                dominated_by[b] += 1;
            }
        }
    }
    let mut sorted = Vec::new();
    let mut front: Vec<usize> =
        (0..costs.len()).filter(|index| dominated_by[*index] == 0).collect();
    while !front.is_empty() {
        let mut next = Vec::new();
        for better in &front {
            for worse in &dominated[*better] {
                dominated_by[*worse] -= 1;
                if dominated_by[*worse] == 0 {
                    next.push(*worse);
                }
            }
        }
        next.sort_unstable();
        sorted.push(std::mem::replace(&mut front, next));
    }
    sorted
}

#[cfg(test)]
mod tests {
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
}

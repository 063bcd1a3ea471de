//! Farthest-point selection (Gonzalez 1985): a few of many, far apart. At most doubles the greatest
//! distance of the best choice.

/// Chosen elements, and the nearest of them to each element.
pub(crate) struct Farthest {
    /// Numbers of the chosen elements, in the order of choice.
    pub(crate) chosen: Vec<usize>,
    /// For each element the place in `chosen` of the nearest one; itself for a chosen element.
    pub(crate) nearest: Vec<usize>,
}

/// Chooses at most `most` of `count` elements, beginning with the first; each is the farthest from
/// those before it, and farther than `least` from all of them. NaN counts as no distance. Ties go
/// to the first, so that the result is the same everywhere.
pub(crate) fn farthest(
    count: usize,
    most: usize,
    least: f64,
    distance: impl Fn(usize, usize) -> f64,
) -> Farthest {
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
    Farthest { chosen, nearest: nearest.into_iter().map(|(_, place)| place).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_the_farthest_from_those_before_it() {
        let at = [0.0_f64, 1.0, 10.0, 4.0, 10.0];
        let apart = |a: usize, b: usize| (at[a] - at[b]).abs();
        let all = farthest(at.len(), 9, f64::NEG_INFINITY, apart);
        assert_eq!(all.chosen, [0, 2, 3, 1, 4], "equal elements too");
        let few = farthest(at.len(), 3, 0.0, apart);
        assert_eq!((few.chosen, few.nearest), (vec![0, 2, 3], vec![0, 0, 1, 2, 1]));
        assert_eq!(farthest(at.len(), 9, 5.0, apart).chosen, [0, 2]);
        assert!(farthest(0, 3, 0.0, apart).chosen.is_empty());
        assert_eq!(farthest(3, 9, 0.0, |_, _| f64::NAN).chosen, [0, 1, 2]);
    }
}

//! Selection of pilot cameras, which render every proposal: few, and representative of all.
//!
//! Medoids: a few elements that represent all, by PAM (Kaufman and Rousseeuw 1990, "Finding Groups in
//! Data", chapter 2). Exchanging one for another cannot lower the sum of distances to the nearest
//! medoid. Where many elements are alike, one of them is a medoid; outliers are none.

use crate::cameras::MovingCamera;

/// Metres equivalent to a turn of 180°.
const METRES_PER_TURN: f32 = 12.0;
/// Most cameras among which pilots are chosen, since all pairs are compared. The first of a set are spread
/// over the whole scene.
const MOST_COMPARED: usize = 1000;

/// Numbers of `count` cameras, the [`medoids`] in position and direction, the most representative
/// first. Cameras far from all others would be those in corners of free space, and the pool would suit
/// them instead of the tracks.
pub(super) fn choose(cameras: &[MovingCamera], count: usize) -> Vec<usize> {
    let cameras = &cameras[..cameras.len().min(MOST_COMPARED)];
    let distance = |a: &MovingCamera, b: &MovingCamera| {
        let turn = a.pose.forward().distance(b.pose.forward()) / 2.0;
        a.pose.position.distance(b.pose.position) / METRES_PER_TURN + turn
    };
    let apart = |a: usize, b: usize| f64::from(distance(&cameras[a], &cameras[b]));
    medoids(cameras.len(), count, apart)
}

/// Numbers of at most `most` of `count` elements, in an order in which each lowers the sum of distances
/// most after those before it. NaN counts as no distance. Ties go to the first, so that the result is the
/// same everywhere.
fn medoids(count: usize, most: usize, distance: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let row = |a: usize| (0..count).map(|b| distance(a, b).max(0.0)).collect::<Vec<f64>>();
    let distances: Vec<Vec<f64>> = (0..count).map(row).collect();
    let sum = |chosen: &[usize]| -> f64 {
        let nearest = |of: usize| {
            chosen.iter().map(|medoid| distances[*medoid][of]).fold(f64::INFINITY, f64::min)
        };
        (0..count).map(nearest).sum()
    };
    // Built one by one …
    let one_by_one = |from: &[usize]| {
        let mut chosen: Vec<usize> = Vec::new();
        while chosen.len() < most.min(count) {
            let with = |next: usize| sum(&[&chosen[..], &[next]].concat());
            let open = from.iter().copied().filter(|next| !chosen.contains(next));
            let sums = open.map(|next| (next, with(next)));
            let Some((next, _)) = sums.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            chosen.push(next);
        }
        chosen
    };
    let mut chosen = one_by_one(&(0..count).collect::<Vec<_>>());
    // … and exchanged while that helps. The sum falls each time, so this ends.
    let mut now = sum(&chosen);
    loop {
        let exchanges = (0..chosen.len()).flat_map(|place| (0..count).map(move |by| (place, by)));
        let after = exchanges.filter(|(_, by)| !chosen.contains(by)).map(|(place, by)| {
            let mut after = chosen.clone();
            after[place] = by;
            (sum(&after), after)
        });
        match after.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((least, after)) if least < now => (now, chosen) = (least, after),
            _ => break,
        }
    }
    chosen.sort_unstable();
    one_by_one(&chosen)
}

#[cfg(test)]
mod tests {
    use frugal_trace::scene::CameraPose;
    use glam::{Quat, Vec3};

    use super::*;

    fn of(at: &[f64], most: usize) -> Vec<usize> {
        let mut chosen = medoids(at.len(), most, |a, b| (at[a] - at[b]).abs());
        chosen.sort_unstable();
        chosen
    }

    #[test]
    fn groups_are_represented_and_outliers_are_not() {
        let at = [0.0, 0.1, 0.2, 0.3, 5.0, 5.1, 5.2, 5.3, 9.0];
        assert_eq!(of(&at, 2), [1, 6], "the first of equally good ones, and the middle of five");
        assert_eq!(of(&at, 3).last(), Some(&8), "a third one is left for the outlier");
        let dense: Vec<f64> =
            (0..40).map(|index| f64::from(index) / 40.0).chain([1.6, -0.6]).collect();
        let chosen = of(&dense, 3);
        assert!(chosen.iter().all(|element| *element < 40), "{chosen:?}");
    }

    #[test]
    fn the_first_represents_most() {
        // Five around 5, three around 0, one at 9.
        let at: [f64; 9] = [0.0, 0.1, 0.2, 5.0, 5.1, 5.2, 5.3, 5.4, 9.0];
        let chosen = medoids(at.len(), 3, |a, b| (at[a] - at[b]).abs());
        assert_eq!(chosen, [5, 1, 8]);
    }

    #[test]
    fn pairs_of_all_of_many_cameras_are_not_compared() {
        let camera = |number: usize| {
            let position = Vec3::X * if number < MOST_COMPARED { 0.0 } else { 100.0 };
            let pose = CameraPose { position, rotation: Quat::IDENTITY };
            MovingCamera { pose, velocity: Vec3::ZERO, turn: Vec3::ZERO, group: 0 }
        };
        // Most are elsewhere, beyond those that are compared.
        let cameras: Vec<MovingCamera> = (0..5 * MOST_COMPARED / 2).map(camera).collect();
        assert_eq!(choose(&cameras, 1), [0]);
    }

    #[test]
    fn odd_numbers_are_no_panic() {
        assert!(of(&[], 3).is_empty());
        assert!(of(&[1.0], 0).is_empty());
        assert_eq!(of(&[1.0, 1.0, 1.0], 9), [0, 1, 2], "equal elements too");
        assert_eq!(medoids(3, 2, |_, _| f64::NAN).len(), 2);
    }
}

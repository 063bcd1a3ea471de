//! Selection of pilot cameras, which render every proposal: few, and representative of all.

use crate::cameras::MovingCamera;
use crate::medoids::medoids;

/// Metres equivalent to a turn of 180°.
const METRES_PER_TURN: f32 = 12.0;

/// Numbers of `count` cameras, the [`medoids`] in position and direction, the most representative
/// first. Cameras far from all others would be those in corners of free space, and the pool would suit
/// them instead of the tracks.
pub(super) fn choose(cameras: &[MovingCamera], count: usize) -> Vec<usize> {
    let distance = |a: &MovingCamera, b: &MovingCamera| {
        let turn = a.pose.forward().distance(b.pose.forward()) / 2.0;
        a.pose.position.distance(b.pose.position) / METRES_PER_TURN + turn
    };
    let apart = |a: usize, b: usize| f64::from(distance(&cameras[a], &cameras[b]));
    medoids(cameras.len(), count, apart)
}

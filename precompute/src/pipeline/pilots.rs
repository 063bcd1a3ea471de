//! Selection of pilot cameras, which render every proposal: few, and far apart.

use crate::cameras::MovingCamera;
use crate::farthest::farthest;

/// Metres equivalent to a turn of 180°.
const METRES_PER_TURN: f32 = 12.0;

/// Numbers of `count` cameras by farthest-point selection in position and direction, beginning with
/// the first.
pub(super) fn choose(cameras: &[MovingCamera], count: usize) -> Vec<usize> {
    let distance = |a: &MovingCamera, b: &MovingCamera| {
        let turn = a.pose.forward().distance(b.pose.forward()) / 2.0;
        a.pose.position.distance(b.pose.position) / METRES_PER_TURN + turn
    };
    let apart = |a: usize, b: usize| f64::from(distance(&cameras[a], &cameras[b]));
    farthest(cameras.len(), count, f64::NEG_INFINITY, apart).chosen
}

//! Selection of pilot cameras, which render every proposal: few, and far apart.

use crate::cameras::MovingCamera;

/// Metres equivalent to a turn of 180°.
const METRES_PER_TURN: f32 = 12.0;

/// Numbers of `count` cameras by farthest-point selection in position and direction (Gonzalez
/// 1985), beginning with the first.
pub(super) fn choose(cameras: &[MovingCamera], count: usize) -> Vec<usize> {
    let distance = |a: &MovingCamera, b: &MovingCamera| {
        let turn = a.pose.forward().distance(b.pose.forward()) / 2.0;
        a.pose.position.distance(b.pose.position) / METRES_PER_TURN + turn
    };
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count.min(cameras.len()) {
        let nearest = |camera: usize| {
            chosen
                .iter()
                .map(|other| distance(&cameras[camera], &cameras[*other]))
                .fold(f32::INFINITY, f32::min)
        };
        let free = (0..cameras.len()).filter(|camera| !chosen.contains(camera));
        // Ties go to the first, so that the result does not depend on iteration order.
        let Some(next) = free.max_by(|a, b| nearest(*a).total_cmp(&nearest(*b)).then(b.cmp(a)))
        else {
            break;
        };
        chosen.push(next);
    }
    chosen
}

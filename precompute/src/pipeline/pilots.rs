//! Which training cameras try every setting: few, and far apart.

use crate::cameras::MovingCamera;

/// Metres that count as much as turning round.
const METRES_PER_TURN: f32 = 12.0;

/// Numbers of `count` cameras: the first, then always the one farthest from those chosen, in place
/// and direction (Gonzalez 1985).
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
        // Of equal ones the first, so that nothing depends on the order of floating-point ties.
        let Some(next) = free.max_by(|a, b| nearest(*a).total_cmp(&nearest(*b)).then(b.cmp(a)))
        else {
            break;
        };
        chosen.push(next);
    }
    chosen
}

//! Camera paths: keys in time, and interpolation of poses.

use frugal_trace::scene::CameraPose;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Greatest interval between two keys of a cut, seconds: the camera jumps from one to the other.
const CUT: f32 = 0.01;

/// A camera's position and look-at point at one time of a path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraKey {
    /// Seconds, greater than the previous key's. Less than 10 ms after it, the camera cuts and does
    /// not travel.
    pub time: f32,
    /// Metres.
    #[serde(with = "frugal_trace::scene::triple")]
    pub position: Vec3,
    /// Look-at point: the centre of the image, metres.
    #[serde(with = "frugal_trace::scene::triple")]
    pub look_at: Vec3,
}

/// A camera path: one key or more, in order of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CameraPath {
    /// The keys.
    pub keys: Vec<CameraKey>,
}

impl CameraPath {
    /// Time of the first key, seconds; 0 without keys.
    pub fn start(&self) -> f32 {
        self.keys.first().map_or(0.0, |key| key.time)
    }

    /// Seconds from the first key to the last.
    pub fn duration(&self) -> f32 {
        self.keys.last().map_or(0.0, |key| key.time - self.start())
    }

    /// The pose at `time`, in seconds on the keys' own clock; clamped to the first and the last
    /// key. `None` without keys.
    ///
    /// Position and look-at point each follow a cubic Hermite curve through the keys whose speed at
    /// a key is that of the parabola through it and its two neighbours (Catmull and Rom 1974, for
    /// keys at uneven times): velocity is continuous at keys.
    pub fn sample(&self, time: f32) -> Option<CameraPose> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        let key_pose = |key: &CameraKey| CameraPose::looking_at(key.position, key.look_at);
        // In this form a time of NaN gives the first key.
        let later = time > first.time;
        if !later {
            return Some(key_pose(first));
        }
        if time >= last.time {
            return Some(key_pose(last));
        }
        let next = self.keys.partition_point(|key| key.time <= time).clamp(1, self.keys.len() - 1);
        let (from, to) = (self.keys[next - 1], self.keys[next]);
        let length = to.time - from.time;
        if length < CUT {
            return Some(key_pose(&from));
        }
        let t = ((time - from.time) / length).clamp(0.0, 1.0);
        let curve = |value: fn(&CameraKey) -> Vec3| {
            let (a, b) = (value(&from), value(&to));
            let (out, into) =
                (self.velocity(next - 1, value) * length, self.velocity(next, value) * length);
            let (t2, t3) = (t * t, t * t * t);
            a * (2.0 * t3 - 3.0 * t2 + 1.0)
                + out * (t3 - 2.0 * t2 + t)
                + b * (3.0 * t2 - 2.0 * t3)
                + into * (t3 - t2)
        };
        Some(CameraPose::looking_at(curve(|key| key.position), curve(|key| key.look_at)))
    }

    /// Metres per second at key `index`.
    fn velocity(&self, index: usize, value: fn(&CameraKey) -> Vec3) -> Vec3 {
        let slope = |from: usize, to: usize| {
            let (a, b) = (&self.keys[from], &self.keys[to]);
            (value(b) - value(a)) / (b.time - a.time)
        };
        // Velocities do not extend across a cut.
        let joined = |from: usize, to: usize| {
            to < self.keys.len() && self.keys[to].time - self.keys[from].time >= CUT
        };
        match (
            index.checked_sub(1).filter(|before| joined(*before, index)),
            joined(index, index + 1),
        ) {
            (None, false) => Vec3::ZERO,
            (None, true) => slope(index, index + 1),
            (Some(before), false) => slope(before, index),
            (Some(before), true) => {
                let (left, right) = (
                    self.keys[index].time - self.keys[before].time,
                    self.keys[index + 1].time - self.keys[index].time,
                );
                (slope(before, index) * right + slope(index, index + 1) * left) / (left + right)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(time: f32, position: Vec3, look_at: Vec3) -> CameraKey {
        CameraKey { time, position, look_at }
    }

    fn path() -> CameraPath {
        CameraPath {
            keys: vec![
                key(1.0, Vec3::ZERO, Vec3::NEG_Z * 5.0),
                key(2.0, Vec3::X, Vec3::X * 9.0),
                key(4.0, Vec3::new(1.0, 1.0, 3.0), Vec3::ZERO),
            ],
        }
    }

    #[test]
    fn passes_its_keys_and_stops_at_its_ends() {
        let path = path();
        assert_eq!((path.start(), path.duration()), (1.0, 3.0));
        for key in &path.keys {
            let pose = path.sample(key.time).unwrap();
            assert!(pose.position.distance(key.position) < 1e-6);
            assert!(pose.forward().distance((key.look_at - key.position).normalize()) < 1e-5);
        }
        for (outside, end) in
            [(-5.0, 0), (f32::NAN, 0), (f32::NEG_INFINITY, 0), (9.0, 2), (f32::INFINITY, 2)]
        {
            assert_eq!(path.sample(outside).unwrap().position, path.keys[end].position);
        }
        assert_eq!(CameraPath::default().sample(0.0), None);
        let single = CameraPath { keys: vec![key(3.0, Vec3::ONE, Vec3::ZERO)] };
        assert_eq!((single.duration(), single.sample(7.0).unwrap().position), (0.0, Vec3::ONE));
    }

    #[test]
    fn position_and_velocity_are_continuous() {
        let path = path();
        let at = |time: f32| path.sample(time).unwrap().position;
        let step = 1e-2;
        let mut time = 1.0 + step;
        while time < 4.0 - step {
            let (before, after) =
                ((at(time) - at(time - step)) / step, (at(time + step) - at(time)) / step);
            assert!((after - before).length() < 0.2, "at {time}: {before} then {after}");
            time += step;
        }
    }

    #[test]
    fn cuts_between_keys_that_all_but_coincide() {
        let keys = [(0.0, 0.0), (1.0, 1.0), (1.005, 50.0), (2.0, 51.0)];
        let path = CameraPath {
            keys: keys.map(|(t, x)| key(t, Vec3::X * x, Vec3::X * x + Vec3::NEG_Z)).to_vec(),
        };
        for i in 0..=2000 {
            let x = path.sample(i as f32 * 1e-3).unwrap().position.x;
            assert!((-1e-3..=1.001).contains(&x) || (49.999..=51.001).contains(&x), "{x}");
        }
    }

    #[test]
    fn keys_on_a_line_at_even_speed_give_an_even_line() {
        let path = CameraPath {
            keys: [0.0, 1.0, 3.0, 4.5]
                .map(|t| key(t, Vec3::X * t, Vec3::X * t + Vec3::NEG_Z))
                .to_vec(),
        };
        for i in 0..45 {
            let time = i as f32 * 0.1;
            assert!(path.sample(time).unwrap().position.distance(Vec3::X * time) < 1e-5);
        }
    }
}

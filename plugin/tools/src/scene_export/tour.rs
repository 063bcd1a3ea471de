//! The camera's way, in keys of equal intervals.

use bevy::math::Vec3;

/// Time between the first keys, seconds.
const INTERVAL_SECONDS: f64 = 0.5;
/// Greatest number of keys. A longer way has every second key dropped and the interval doubled.
const MAX_KEYS: usize = 600;

/// A place at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Key {
    /// Seconds since the first key.
    pub seconds: f64,
    /// Position, metres.
    pub position: Vec3,
    /// Viewing direction, of unit length.
    pub forward: Vec3,
}

/// Where the camera has been.
#[derive(Debug)]
pub(super) struct Tour {
    keys: Vec<Key>,
    start_seconds: f64,
    interval_seconds: f64,
}

impl Default for Tour {
    fn default() -> Self {
        Self { keys: Vec::new(), start_seconds: 0.0, interval_seconds: INTERVAL_SECONDS }
    }
}

impl Tour {
    pub(super) fn push(&mut self, now_seconds: f64, position: Vec3, forward: Vec3) {
        if !(position.is_finite() && forward.is_finite()) {
            return;
        }
        let Some(last) = self.keys.last() else {
            self.start_seconds = now_seconds;
            self.keys.push(Key { seconds: 0.0, position, forward });
            return;
        };
        let seconds = now_seconds - self.start_seconds;
        if seconds - last.seconds < self.interval_seconds {
            return;
        }
        if self.keys.len() == MAX_KEYS {
            let mut number = 0;
            self.keys.retain(|_| (number += 1, number % 2 == 1).1);
            self.interval_seconds *= 2.0;
        }
        self.keys.push(Key { seconds, position, forward });
    }

    /// One key where the camera never moved.
    pub(super) fn keys(&self) -> &[Key] {
        let is_still = |key: &Key| {
            let first = &self.keys[0];
            key.position.distance(first.position) < 1e-3
                && key.forward.dot(first.forward) > 0.999_99
        };
        if self.keys.iter().all(is_still) {
            &self.keys[..self.keys.len().min(1)]
        } else {
            &self.keys
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_way_has_fewer_keys_of_all_of_it() {
        let mut tour = Tour::default();
        for frame in 0..60_000 {
            tour.push(7.0 + f64::from(frame) / 60.0, Vec3::X * frame as f32, Vec3::Z);
        }
        let keys = tour.keys();
        assert!((300..=MAX_KEYS).contains(&keys.len()), "{} keys", keys.len());
        assert_eq!(keys[0].position, Vec3::ZERO);
        assert!(keys[keys.len() - 1].seconds > 990.0, "{:?}", keys.last());
        assert!(keys.windows(2).all(|pair| pair[1].seconds - pair[0].seconds > 0.4));
    }

    #[test]
    fn a_still_camera_has_one_key() {
        let mut tour = Tour::default();
        assert!(tour.keys().is_empty());
        tour.push(0.0, Vec3::NAN, Vec3::Z);
        (1..9).for_each(|second| tour.push(f64::from(second), Vec3::Y, Vec3::Z));
        assert_eq!(tour.keys(), [Key { seconds: 0.0, position: Vec3::Y, forward: Vec3::Z }]);
    }
}

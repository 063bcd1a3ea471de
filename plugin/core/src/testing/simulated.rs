//! A simulated device and its meter, for tests. Plain numbers: no clock of its own, no threads,
//! deterministic.
//!
//! Power = idle + gain × demand × clock², a frame's work being paced by the frame rate. Heat flows
//! from the device to the room through a thermal resistance, and a governor lowers the clock while
//! the device is too hot.

use crate::units::Watts;

/// Power model, thermal mass and clock of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedDevice {
    /// Power without any work, in watts; finite, at least 0.
    pub idle: Watts,
    /// Power per watt of demand, at full clock; finite, above 0. Above 1: hungrier than the device
    /// whose watts the demand is in.
    pub gain: f64,
    /// Heat that warms the device by one kelvin, J/K; finite, above 0.
    pub thermal_mass: f64,
    /// Temperature difference to the room per watt, K/W; finite, at least 0.
    pub thermal_resistance: f64,
    /// Temperature above that of the room at which the governor lowers the clock, in kelvin;
    /// infinity never throttles.
    pub throttles_at: f64,
    /// Clock while throttled, as a share of the full clock; in (0, 1].
    pub throttled_clock: f64,
    /// Temperature above that of the room, in kelvin; finite.
    pub temperature: f64,
    /// Whether the governor has lowered the clock.
    pub is_throttled: bool,
}

impl Default for SimulatedDevice {
    /// A device as hungry as the demand says, without idle power, that never throttles.
    fn default() -> Self {
        Self {
            idle: Watts(0.0),
            gain: 1.0,
            thermal_mass: 40.0,
            thermal_resistance: 1.0,
            throttles_at: f64::INFINITY,
            throttled_clock: 0.8,
            temperature: 0.0,
            is_throttled: false,
        }
    }
}

impl SimulatedDevice {
    /// Advances by `delta_seconds` (at least 0) with a demand of `demand` watts, and returns the
    /// power drawn.
    pub fn step(&mut self, demand: Watts, delta_seconds: f64) -> Watts {
        let clock = if self.is_throttled { self.throttled_clock } else { 1.0 };
        let power = self.idle + demand * (self.gain * clock * clock);
        let loss = self.temperature / self.thermal_resistance.max(1e-9);
        self.temperature += (power.0 - loss) * delta_seconds / self.thermal_mass;
        // Three kelvin of hysteresis, as governors have.
        self.is_throttled = self.temperature > self.throttles_at
            || (self.is_throttled && self.temperature > self.throttles_at - 3.0);
        power
    }
}

/// A meter that averages over an interval, is late, noisy, and may be lost.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedMeter {
    /// Interval of a reading, in seconds; above 0. Long ones give the staircase of slow counters.
    pub interval_seconds: f64,
    /// Time from the end of an interval to its reading, in seconds; at least 0.
    pub latency_seconds: f64,
    /// Standard deviation of a reading, as a share of it; at least 0.
    pub noise: f64,
    /// Whether it gives no readings.
    pub is_lost: bool,
    joules: f64,
    seconds: f64,
    /// Readings on their way, with the seconds left; the oldest first.
    pending: std::collections::VecDeque<(f64, Watts, f64)>,
    random: u64,
}

impl SimulatedMeter {
    /// A meter with readings of `interval_seconds`, without latency or noise.
    pub fn new(interval_seconds: f64) -> Self {
        Self {
            interval_seconds,
            latency_seconds: 0.0,
            noise: 0.0,
            is_lost: false,
            joules: 0.0,
            seconds: 0.0,
            pending: std::collections::VecDeque::new(),
            random: 0x9e37_79b9_7f4a_7c15,
        }
    }

    /// Sets [`latency_seconds`](Self::latency_seconds).
    #[must_use]
    pub fn with_latency(self, seconds: f64) -> Self {
        Self { latency_seconds: seconds, ..self }
    }

    /// Sets [`noise`](Self::noise).
    #[must_use]
    pub fn with_noise(self, noise: f64) -> Self {
        Self { noise, ..self }
    }

    /// Advances by `delta_seconds` at `power`. Returns a reading that arrives: the mean power of
    /// its interval, and the interval's length in seconds.
    pub fn step(&mut self, power: Watts, delta_seconds: f64) -> Option<(Watts, f64)> {
        self.joules += power.0 * delta_seconds;
        self.seconds += delta_seconds;
        for (left, ..) in &mut self.pending {
            *left -= delta_seconds;
        }
        // A rounding error must not delay a reading by a frame.
        if self.seconds >= self.interval_seconds - 1e-9 {
            let noisy = self.joules / self.seconds * (1.0 + self.noise * self.normal());
            self.pending.push_back((self.latency_seconds, Watts(noisy.max(0.0)), self.seconds));
            (self.joules, self.seconds) = (0.0, 0.0);
        }
        let is_here = self.pending.front().is_some_and(|(left, ..)| *left <= 1e-9);
        let (_, watts, seconds) = self.pending.pop_front_if(|_| is_here)?;
        (!self.is_lost).then_some((watts, seconds))
    }

    /// A number of mean 0 and standard deviation 1: the sum of twelve uniform ones less six.
    fn normal(&mut self) -> f64 {
        let mut uniform = || {
            // Marsaglia's xorshift: reproducible, and good enough for noise.
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            (self.random >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_warms_up_to_its_power_times_its_resistance_and_throttles() {
        let mut device = SimulatedDevice { idle: Watts(2.0), gain: 2.0, ..Default::default() };
        for _ in 0..10_000 {
            assert_eq!(device.step(Watts(4.0), 0.1), Watts(10.0));
        }
        assert!((device.temperature - 10.0).abs() < 0.01, "{}", device.temperature);
        device.throttles_at = 9.0;
        device.step(Watts(4.0), 0.1);
        assert!(device.is_throttled);
        let power = device.step(Watts(4.0), 0.1).0;
        assert!((power - (2.0 + 8.0 * 0.64)).abs() < 1e-9, "{power}");
    }

    #[test]
    fn readings_are_means_of_their_intervals_and_arrive_late() {
        let mut meter = SimulatedMeter::new(0.2).with_latency(0.1);
        let readings: Vec<_> = (0..8)
            .map(|step| meter.step(Watts(f64::from(step)), 0.1))
            .enumerate()
            .filter_map(|(step, reading)| Some((step, reading?.0.0)))
            .collect();
        assert_eq!(readings, [(2, 0.5), (4, 2.5), (6, 4.5)]);
        meter.is_lost = true;
        assert!((0..20).all(|_| meter.step(Watts(1.0), 0.1).is_none()));
    }

    #[test]
    fn noise_has_the_deviation_that_was_asked_for() {
        let mut meter = SimulatedMeter::new(0.1).with_noise(0.05);
        let readings: Vec<f64> =
            (0..4000).filter_map(|_| Some(meter.step(Watts(10.0), 0.1)?.0.0)).collect();
        let mean = readings.iter().sum::<f64>() / readings.len() as f64;
        let variance =
            readings.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / readings.len() as f64;
        assert!((mean - 10.0).abs() < 0.05 && (variance.sqrt() - 0.5).abs() < 0.05);
    }
}

//! What power was predicted for the seconds that a meter's reading is about, and how late its readings are.
//!
//! A battery's gauge reports what was, seconds ago. Of all delays in whole seconds, the meter's is the
//! one at which changes of the predictions explain changes of the readings best (Knapp and Carter 1976,
//! "The generalized correlation method for estimation of time delay", for one signal that is known).
//! Levels would not do: a device that turns hungrier fits some delay by chance.

use std::collections::VecDeque;

/// Longest delay that is looked for, seconds. Higher values find a delay by chance sooner.
const MAX_DELAY: usize = 40;
/// Seconds of the two means whose difference is a change, at least; a reading's interval where that is
/// longer. Higher values bear delays of half a second and noise; lower values tell more changes apart.
const CHANGE_SECONDS: usize = 3;
/// Longest interval of a reading, seconds.
const MAX_INTERVAL: usize = 20;
/// Largest change that counts, as a share of the sum of the two: one large step says no more than one.
const MAX_CHANGE: f64 = 0.03;
/// Seconds of predictions that are kept.
const KEPT: usize = MAX_DELAY + 2 * MAX_INTERVAL;
/// Time constant of the correction of a mean, and of what is known of delays, seconds. Higher values follow
/// a device that warms up later; lower values mistake a view's error for the device's, and swing where a
/// meter is late.
pub(super) const MEAN_SECONDS: f64 = 240.0;
/// Seconds of change, all alike, that a delay needs before it is believed: a few steps, of which each
/// spans three. One step of a device and one of its settings lie at some delay by chance.
const LEAST_CHANGES: f64 = 8.0;
/// What a delay may leave unexplained, as a share of what none leaves.
const MOST_LEFT: f64 = 0.3;
/// And of what the delay in use leaves, so that neighbours do not take turns.
const MOST_OF_PRESENT: f64 = 0.8;

/// Time constant of the recent ratio of energies, seconds. Higher values notice later that a device has
/// changed; lower values mistake a view's error for that.
const RECENT_SECONDS: f64 = 20.0;
/// Factor between the recent ratio and that of minutes from which the device is another: a charger was
/// plugged in, another app began. Higher values leave such a change to fade; lower values follow views.
const OTHER_DEVICE: f64 = 1.15;
/// Share of the recent energies that counts then: most of them are of the device before.
const KEPT_OF_RECENT: f64 = 0.25;

/// Predicted and metered energy, joules.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Energies {
    /// Of minutes, in which older ones fade.
    kept: [f64; 2],
    /// The same of the last seconds.
    recent: [f64; 2],
    /// Seconds of the recent ones, which fade as they do.
    seconds: f64,
}

impl Energies {
    /// Adds a reading of `watts`, the mean of `seconds`.
    pub(super) fn add(&mut self, predicted: f64, watts: f64, seconds: f64) {
        let fade = |time: f64| (-seconds / time).exp();
        for (sums, time) in [(&mut self.kept, MEAN_SECONDS), (&mut self.recent, RECENT_SECONDS)] {
            for (sum, watts) in sums.iter_mut().zip([predicted, watts]) {
                *sum = *sum * fade(time) + watts * seconds;
            }
        }
        self.seconds = self.seconds * fade(RECENT_SECONDS) + seconds;
        let other = ratio(self.recent) / ratio(self.kept);
        if self.seconds > 0.5 * RECENT_SECONDS
            && !(OTHER_DEVICE.recip()..=OTHER_DEVICE).contains(&other)
        {
            self.kept = self.recent.map(|sum| sum * KEPT_OF_RECENT);
        }
    }

    /// Metered watts per predicted watt; not finite or not above 0 before the first reading.
    pub(super) fn gain(&self) -> f64 {
        ratio(self.kept)
    }
}

fn ratio([predicted, metered]: [f64; 2]) -> f64 {
    metered / predicted
}

/// Squares of changes, of which older ones fade.
#[derive(Clone, Copy, Debug, Default)]
struct Squares {
    predicted: f64,
    both: f64,
    metered: f64,
    /// Of `both`.
    fourth: f64,
}

impl Squares {
    fn add(&mut self, predicted: f64, metered: f64, kept: f64) {
        self.predicted = self.predicted * kept + predicted * predicted;
        self.both = self.both * kept + predicted * metered;
        self.metered = self.metered * kept + metered * metered;
        self.fourth = self.fourth * kept + (predicted * metered).powi(2);
    }

    /// Number of changes, if all were alike.
    fn count(&self) -> f64 {
        if self.fourth > 0.0 { self.both * self.both / self.fourth } else { 0.0 }
    }

    /// What no rising line through 0 explains.
    fn unexplained(&self) -> f64 {
        let both = self.both.max(0.0);
        let explained = if self.predicted > 0.0 { both * both / self.predicted } else { 0.0 };
        (self.metered - explained).max(0.0)
    }
}

/// A delay.
#[derive(Clone, Copy, Debug, Default)]
struct Candidate {
    energies: Energies,
    delayed: Squares,
    /// Without a delay, of the same readings.
    prompt: Squares,
}

impl Candidate {
    /// What the delay leaves unexplained, as a share of what none leaves.
    fn left(&self) -> f64 {
        let share = self.delayed.unexplained() / self.prompt.unexplained();
        if share.is_finite() && self.delayed.count() >= LEAST_CHANGES { share } else { 1.0 }
    }
}

/// Means of seconds, in watts; the latest last.
#[derive(Clone, Debug, Default)]
struct Seconds {
    means: VecDeque<f64>,
    /// Joules and seconds of the one that is not over.
    begun: [f64; 2],
}

impl Seconds {
    /// Adds `watts` over `seconds`; returns how many seconds have ended.
    fn add(&mut self, watts: f64, seconds: f64) -> usize {
        let (mut left, mut ended) = (seconds.min(KEPT as f64), 0);
        // A rounding error neither leaves a second open nor begins one.
        while left > 1e-9 {
            let part = left.min(1.0 - self.begun[1]);
            self.begun = [self.begun[0] + watts * part, self.begun[1] + part];
            left -= part;
            if self.begun[1] >= 1.0 - 1e-9 {
                if self.means.len() == KEPT {
                    self.means.pop_front();
                }
                self.means.push_back(self.begun[0] / self.begun[1]);
                self.begun = [0.0; 2];
                ended += 1;
            }
        }
        ended
    }

    fn clear(&mut self) {
        self.means.clear();
        self.begun = [0.0; 2];
    }

    /// The `count` seconds that ended `ago` seconds before the last.
    fn slice(&self, count: usize, ago: usize) -> Option<impl Iterator<Item = f64> + '_> {
        let end = self.means.len().checked_sub(ago)?;
        let start = end.checked_sub(count)?;
        Some(self.means.range(start..end).copied())
    }

    fn mean(&self, count: usize, ago: usize) -> Option<f64> {
        Some(self.slice(count, ago)?.sum::<f64>() / count as f64)
    }

    /// The mean of the last `count` seconds less that of as many before, `ago` seconds ago, as a share of
    /// their sum, within limits.
    fn change(&self, count: usize, ago: usize) -> Option<f64> {
        let before = self.mean(count, ago + count)?;
        let after = self.mean(count, ago)?;
        let change = (after - before) / (after + before);
        Some(if change.is_finite() { change.clamp(-MAX_CHANGE, MAX_CHANGE) } else { 0.0 })
    }
}

/// Finds the delay of a meter from predictions and readings.
#[derive(Clone, Debug)]
pub(super) struct DelayFinder {
    predicted: Seconds,
    metered: Seconds,
    candidates: Vec<Candidate>,
    delay: usize,
}

impl Default for DelayFinder {
    fn default() -> Self {
        Self {
            predicted: Seconds::default(),
            metered: Seconds::default(),
            candidates: vec![Candidate::default(); MAX_DELAY + 1],
            delay: 0,
        }
    }
}

impl DelayFinder {
    /// Adds a prediction of plausible `watts` over `seconds` above 0.
    pub(super) fn predict(&mut self, watts: f64, seconds: f64) {
        self.predicted.add(watts, seconds);
    }

    /// Forgets predictions and readings, but not the delay.
    pub(super) fn pause(&mut self) {
        self.predicted.clear();
        self.metered.clear();
    }

    /// Adds a reading of plausible `watts`, the mean of `seconds`.
    pub(super) fn read(&mut self, watts: f64, seconds: f64) {
        let ended = self.metered.add(watts, seconds);
        if !(1..=MAX_INTERVAL).contains(&ended) {
            return;
        }
        let span = ended.max(CHANGE_SECONDS);
        let seconds = ended as f64;
        let kept = (-seconds / MEAN_SECONDS).exp();
        let Some(metered) = self.metered.mean(ended, 0) else { return };
        let prompt = self.predicted.change(span, 0).zip(self.metered.change(span, 0));
        for (delay, candidate) in self.candidates.iter_mut().enumerate().skip(1) {
            let Some(predicted) = self.predicted.mean(ended, delay) else { break };
            candidate.energies.add(predicted, metered, seconds);
            if let Some((delayed, (prompt, change))) =
                self.predicted.change(span, delay).zip(prompt)
            {
                candidate.delayed.add(delayed, change, kept);
                candidate.prompt.add(prompt, change, kept);
            }
        }
        let left = |delay: usize| if delay == 0 { 1.0 } else { self.candidates[delay].left() };
        let best = (0..=MAX_DELAY).min_by(|a, b| left(*a).total_cmp(&left(*b))).unwrap_or(0);
        let present = left(self.delay);
        if best > 0 && left(best) < MOST_LEFT.min(MOST_OF_PRESENT * present) {
            self.delay = best;
        } else if present > MOST_OF_PRESENT {
            self.delay = 0;
        }
    }

    /// The delay, seconds; 0 unless a greater one is certain.
    pub(super) fn delay(&self) -> usize {
        self.delay
    }

    /// The energies at the delay; `None` without one.
    pub(super) fn energies(&self) -> Option<Energies> {
        (self.delay > 0).then_some(self.candidates[self.delay].energies)
    }

    /// What a reading of an interval was a measure of: mean and range of predictions, watts.
    pub(super) fn of_reading(&self, seconds: f64) -> Option<(f64, f64)> {
        let count = (seconds.round() as usize).clamp(1, MAX_INTERVAL);
        let mean = self.predicted.mean(count, self.delay)?;
        // The meter's seconds begin within those of the predictions.
        let around = self.predicted.slice(count + 1, self.delay.saturating_sub(1))?;
        let range = |(low, high): (f64, f64), watts: f64| (low.min(watts), high.max(watts));
        let (low, high) = around.fold((mean, mean), range);
        Some((mean, high - low))
    }
}

/// Shortest part of the history, seconds: shorter frames share one.
const PART_SECONDS: f64 = 0.02;
/// Number of parts: five seconds at least.
const PARTS: usize = 256;
/// Lag of a meter beyond its interval, seconds, within which a change makes a reading uncertain.
const LAG_SECONDS: f64 = 0.25;

/// Largest plausible power, watts: beyond, a number is no power of a machine that runs this plugin.
pub(super) const MAX_WATTS: f64 = 1e5;

/// A ring of powers with their durations; allocates once.
#[derive(Clone, Debug)]
pub(super) struct PredictionHistory(VecDeque<(f64, f64)>);

impl Default for PredictionHistory {
    fn default() -> Self {
        Self(VecDeque::with_capacity(PARTS + 1))
    }
}

impl PredictionHistory {
    /// Adds `watts` over `seconds`, if the power is plausible, and the time finite and above 0; returns
    /// whether they are.
    pub(super) fn push(&mut self, watts: f64, seconds: f64) -> bool {
        let is_time = seconds > 0.0 && seconds.is_finite();
        if !((0.0..=MAX_WATTS).contains(&watts) && is_time) {
            return false;
        }
        match self.0.back_mut() {
            Some((mean, length)) if *length < PART_SECONDS => {
                *mean = (*mean * *length + watts * seconds) / (*length + seconds);
                *length += seconds;
            }
            _ => {
                if self.0.len() == PARTS {
                    self.0.pop_front();
                }
                self.0.push_back((watts, seconds));
            }
        }
        true
    }

    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// The latest power, watts.
    pub(super) fn last(&self) -> Option<f64> {
        self.0.back().map(|(watts, _)| *watts)
    }

    /// Mean over the last `seconds`, and the range of values then and shortly before, both in
    /// watts. `None` if a tenth of that time is unknown.
    pub(super) fn mean(&self, seconds: f64) -> Option<(f64, f64)> {
        let (mut sum, mut length, mut passed) = (0.0, 0.0, 0.0);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (watts, part) in self.0.iter().rev() {
            if passed >= seconds + LAG_SECONDS {
                break;
            }
            let inside = part.min(seconds - length).max(0.0);
            (sum, length) = (sum + watts * inside, length + inside);
            (low, high) = (low.min(*watts), high.max(*watts));
            passed += part;
        }
        // A meter of long intervals is compared with what there is. What it measured while nothing was
        // predicted belongs to something else.
        let enough = length >= 0.9 * seconds.min(PARTS as f64 * PART_SECONDS);
        (length > 0.0 && enough).then(|| (sum / length, high - low))
    }
}

#[cfg(test)]
#[path = "delay_tests.rs"]
mod tests;

//! Statistics of control logs, which apps write: budgets, power, error and switches by run and
//! camera. Independent of the renderer.

use std::collections::{BTreeMap, BTreeSet};

use bevy_frugal_gi_tools::control_log::ControlSample;

/// Length of the windows in which a power limit is judged, seconds.
const WINDOW_SECONDS: f64 = 1.0;
/// Part by which the mean of a window exceeds the limit before it counts as over.
const TOLERANCE: f64 = 0.02;

/// The samples of one camera in one run, in the order of time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CameraLog {
    /// Number of the run in the file, from 1.
    pub run: usize,
    /// Number of the camera in the run, from 0.
    pub camera: u32,
    /// Number of cameras of the run.
    pub of: usize,
    /// The samples; never empty.
    pub samples: Vec<ControlSample>,
}

/// The cameras of all runs of a log. A run begins where time goes back, since an app's clock starts
/// at 0.
pub(crate) fn cameras(samples: &[ControlSample]) -> Vec<CameraLog> {
    let runs = samples.chunk_by(|before, after| after.time_s >= before.time_s);
    runs.enumerate()
        .flat_map(|(run, samples)| {
            let numbers: BTreeSet<u32> = samples.iter().map(|sample| sample.camera).collect();
            let of = numbers.len();
            numbers.into_iter().map(move |camera| CameraLog {
                run: run + 1,
                camera,
                of,
                samples: samples.iter().filter(|one| one.camera == camera).cloned().collect(),
            })
        })
        .collect()
}

impl CameraLog {
    /// Seconds from the first to the last sample.
    pub(crate) fn seconds(&self) -> f64 {
        let time = |sample: Option<&ControlSample>| sample.map_or(0.0, |sample| sample.time_s);
        time(self.samples.last()) - time(self.samples.first())
    }

    /// Mean over the samples that have a value, each for as long as it lasts.
    pub(crate) fn mean(&self, value: impl Fn(&ControlSample) -> Option<f64>) -> Option<f64> {
        let known: Vec<&ControlSample> =
            self.samples.iter().filter(|sample| value(sample).is_some()).collect();
        mean(&known, &value)
    }

    /// The limit of power that its metered power is held against: the whole app's, or that of the
    /// only camera; the least of them. `None` without a limit.
    pub(crate) fn metered_limit(&self, sample: &ControlSample) -> Option<f64> {
        let own = sample.power_budget_w.filter(|_| self.of == 1);
        [own, sample.app_budget_w].into_iter().flatten().reduce(f64::min)
    }

    /// Number of windows of 1 s with metered power and a limit, and of those the number whose mean
    /// exceeds the limit by more than 2 %.
    pub(crate) fn windows_over(&self) -> (usize, usize) {
        let readings: Vec<&ControlSample> =
            self.samples.iter().filter(|sample| sample.metered_w.is_some()).collect();
        let start = self.samples.first().map_or(0.0, |sample| sample.time_s);
        let window = |sample: &ControlSample| ((sample.time_s - start) / WINDOW_SECONDS) as u64;
        let mut counts = (0, 0);
        for readings in readings.chunk_by(|a, b| window(a) == window(b)) {
            let limit = readings.iter().filter_map(|sample| self.metered_limit(sample));
            // A limit that changes within the window: the loosest.
            let Some(limit) = limit.reduce(f64::max) else { continue };
            let watts: f64 = readings.iter().filter_map(|sample| sample.metered_w).sum();
            counts.0 += 1;
            let is_over = watts / readings.len() as f64 > limit * (1.0 + TOLERANCE);
            counts.1 += usize::from(is_over);
        }
        counts
    }

    /// The statuses with the share of the samples that have them, the most frequent first.
    pub(crate) fn statuses(&self) -> Vec<(&str, f64)> {
        shares(self.samples.iter().map(|sample| sample.status.as_str()))
    }

    /// Switches per second; `None` for a run without duration.
    pub(crate) fn switches_per_second(&self) -> Option<f64> {
        let switches: u32 = self.samples.iter().map(|sample| sample.switches).sum();
        Some(f64::from(switches) / self.seconds()).filter(|rate| rate.is_finite())
    }

    /// The longest frame, milliseconds, without the first sample: an app loads then.
    pub(crate) fn longest_frame_ms(&self) -> Option<f64> {
        self.samples.iter().skip(1).filter_map(|sample| sample.longest_frame_ms).reduce(f64::max)
    }
}

/// Mean of `samples`, all with a value, weighted by the time to the next one.
fn mean(samples: &[&ControlSample], value: &impl Fn(&ControlSample) -> Option<f64>) -> Option<f64> {
    let last = samples.last().and_then(|sample| value(sample))?;
    let (mut sum, mut seconds) = (0.0, 0.0);
    for two in samples.windows(2) {
        let lasts = two[1].time_s - two[0].time_s;
        sum += value(two[0])? * lasts;
        seconds += lasts;
    }
    Some(if seconds > 0.0 { sum / seconds } else { last })
}

/// The values with their shares, the most frequent first.
fn shares<'a>(values: impl IntoIterator<Item = &'a str>) -> Vec<(&'a str, f64)> {
    let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
    values.into_iter().for_each(|value| *counts.entry(value).or_default() += 1.0);
    let all: f64 = counts.values().sum();
    let shares = counts.into_iter().map(|(value, count)| (value, count / all));
    let mut shares: Vec<(&str, f64)> = shares.collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

/// The knobs whose levels change over `samples` of one camera, in the order of their names in the
/// log: each with the number of its changes, and with the shares of its levels.
pub(crate) fn changes(samples: &[ControlSample]) -> Vec<(&str, usize, Vec<(&str, f64)>)> {
    let mut knobs: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, level) in samples.iter().flat_map(|sample| levels(&sample.settings)) {
        match knobs.iter_mut().find(|(known, _)| *known == name) {
            Some((_, levels)) => levels.push(level),
            None => knobs.push((name, vec![level])),
        }
    }
    let changed = |levels: &[&str]| levels.windows(2).filter(|two| two[0] != two[1]).count();
    let knobs = knobs.into_iter().map(|(name, levels)| (name, changed(&levels), shares(levels)));
    knobs.filter(|(_, changes, _)| *changes > 0).collect()
}

/// Knobs and levels of settings as an app describes them: `a=1,b=on`.
fn levels(settings: &str) -> impl Iterator<Item = (&str, &str)> {
    settings.split([',', ' ']).filter_map(|part| part.split_once('='))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(time_s: f64, camera: u32, metered: Option<f64>) -> ControlSample {
        ControlSample {
            time_s,
            camera,
            status: if time_s < 1.0 { "settling" } else { "met" }.into(),
            power_budget_w: Some(5.0),
            predicted_w: Some(4.0 + time_s),
            metered_w: metered,
            switches: 1,
            longest_frame_ms: Some(100.0 - 10.0 * time_s),
            ..ControlSample::default()
        }
    }

    #[test]
    fn runs_and_cameras_are_told_apart() {
        let times = [(0.0, 0), (0.0, 1), (1.0, 0), (1.0, 1), (0.5, 0), (1.5, 0)];
        let logs = cameras(&times.map(|(time, camera)| sample(time, camera, None)));
        let found: Vec<_> =
            logs.iter().map(|log| (log.run, log.camera, log.of, log.samples.len())).collect();
        assert_eq!(found, [(1, 0, 2, 2), (1, 1, 2, 2), (2, 0, 1, 2)]);
        assert!(cameras(&[]).is_empty());
    }

    #[test]
    fn windows_over_the_limit_are_counted() {
        // Windows of 5.0, 5.05 and 5.2 W against 5 W; one without a reading.
        let readings = [4.8, 5.2, 5.05, 5.05, 5.2, 5.2];
        let mut samples: Vec<_> = readings
            .iter()
            .enumerate()
            .map(|(index, watts)| sample(0.5 * index as f64, 0, Some(*watts)))
            .collect();
        samples.push(sample(3.2, 0, None));
        let mut log = cameras(&samples).remove(0);
        assert_eq!(log.windows_over(), (3, 1));
        // The meter reads the whole app: with two cameras one's own limit says nothing about it.
        log.of = 2;
        assert_eq!(log.windows_over(), (0, 0));
        log.samples.iter_mut().for_each(|sample| sample.app_budget_w = Some(4.9));
        assert_eq!(log.windows_over(), (3, 3));
    }

    #[test]
    fn means_are_over_time() {
        // 4 W for 1 s, 5 W for 3 s.
        let log = cameras(&[0.0, 1.0, 4.0].map(|time| sample(time, 0, None))).remove(0);
        assert_eq!(log.mean(|sample| sample.predicted_w), Some(4.75));
        assert_eq!(log.mean(|sample| sample.metered_w), None);
        assert_eq!((log.seconds(), log.switches_per_second()), (4.0, Some(0.75)));
        assert_eq!(log.statuses(), [("met", 2.0 / 3.0), ("settling", 1.0 / 3.0)]);
        assert_eq!(log.longest_frame_ms(), Some(90.0), "not the first");
        let single = cameras(&[sample(2.0, 0, Some(3.0))]).remove(0);
        assert_eq!((single.seconds(), single.switches_per_second()), (0.0, None));
        assert_eq!(single.mean(|sample| sample.metered_w), Some(3.0));
    }

    #[test]
    fn only_knobs_that_change_are_counted() {
        let sample = |settings: &str| ControlSample {
            settings: settings.to_owned(),
            ..ControlSample::default()
        };
        let samples = ["", "a=1,b=off", "a=2,b=off", "a=2,b=off", "a=1,b=off,c=x"].map(sample);
        assert_eq!(changes(&samples), [("a", 2, vec![("1", 0.5), ("2", 0.5)])]);
        assert!(changes(&[]).is_empty() && changes(&[sample("odd"), sample("=,=")]).is_empty());
    }
}

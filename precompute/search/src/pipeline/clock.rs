//! The time of a run, over all its sessions: what an interrupted one has used counts when it goes on.

use std::time::{Duration, Instant};

/// The clock of a session.
pub(super) struct Clock {
    started: Instant,
    limit: Option<Duration>,
    /// What earlier sessions have spent: seconds, those of them in renderings, and the number of these.
    before: [f64; 3],
    /// Number of renderings made in this session.
    pub(super) made: usize,
    /// The time that they took, seconds.
    pub(super) seconds: f64,
}

impl Clock {
    /// Starts the clock, or continues that of earlier sessions, where these wrote some of `records`.
    pub(super) fn start(limit: Option<Duration>, records: &[String]) -> Self {
        let before = records.iter().rev().find_map(|record| read(record)).unwrap_or_default();
        Self { started: Instant::now(), limit, before, made: 0, seconds: 0.0 }
    }

    /// A record for later sessions, where there is a limit.
    pub(super) fn record(&self) -> Option<String> {
        self.limit.is_some().then(|| text(self.spent()))
    }

    /// Whether `more` renderings will probably finish within `share` of the limit, by the duration of
    /// those before. Always true without a limit.
    pub(super) fn has_time(&self, more: usize, share: f64) -> bool {
        let Some(limit) = self.limit else { return true };
        let [elapsed, rendering, made] = self.spent();
        let each = if made > 0.0 { rendering / made } else { 0.0 };
        elapsed + each * more as f64 <= share * limit.as_secs_f64()
    }

    fn spent(&self) -> [f64; 3] {
        let now = [self.started.elapsed().as_secs_f64(), self.seconds, self.made as f64];
        std::array::from_fn(|part| self.before[part] + now[part])
    }
}

fn text([elapsed, rendering, made]: [f64; 3]) -> String {
    format!("spent {elapsed} {rendering} {made}")
}

fn read(record: &str) -> Option<[f64; 3]> {
    let words = record.strip_prefix("spent ")?.split(' ');
    let numbers =
        words.map(|word| word.parse().ok().filter(|it: &f64| it.is_finite() && *it >= 0.0));
    numbers.collect::<Option<Vec<f64>>>()?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_goes_on_with_the_time_and_the_pace_of_earlier_ones() {
        let limit = Some(Duration::from_secs(100));
        let mut first = Clock::start(limit, &[]);
        (first.made, first.seconds) = (10, 10.0);
        let record = first.record().expect("limited");
        let next =
            Clock::start(limit, &["spent 1 1 1".to_owned(), record, "decide a 1".to_owned()]);
        // A second each.
        assert!(next.has_time(90, 1.0) && !next.has_time(101, 1.0) && !next.has_time(60, 0.5));
        assert_eq!((next.made, next.seconds), (0, 0.0), "of this session");
        let late = Clock::start(limit, &["spent 99.5 10 10".to_owned()]);
        assert!(late.has_time(0, 1.0) && !late.has_time(1, 1.0));
        let free = Clock::start(None, &[]);
        assert!(free.has_time(usize::MAX, 0.0) && free.record().is_none());
    }

    #[test]
    fn records_survive_to_the_last_bit() {
        let spent = [0.1 + 0.2, 1e-9, 7.0];
        assert_eq!(read(&text(spent)), Some(spent));
        for record in ["spent 1 2", "spent 1 NaN 3", "spent -1 2 3", "spent 1 2 -3", "render"] {
            assert_eq!(read(record), None);
        }
    }
}

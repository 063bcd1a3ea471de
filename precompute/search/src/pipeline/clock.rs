//! The time of a run, over all its sessions: what an interrupted one has used counts when it goes on.

use std::time::{Duration, Instant};

/// The clock of a session.
pub(super) struct Clock {
    started: Instant,
    limit: Option<Duration>,
    /// Of earlier sessions.
    before: Spent,
    /// Number of renderings made in this session, and the time that they took, seconds.
    made: usize,
    seconds: f64,
}

/// What a run has spent: seconds, those of them in renderings, and the number of these.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Spent {
    elapsed: f64,
    rendering: f64,
    made: usize,
}

impl Clock {
    pub(super) fn start(limit: Option<Duration>) -> Self {
        Self { started: Instant::now(), limit, before: Spent::default(), made: 0, seconds: 0.0 }
    }

    /// Continues an earlier session's clock, where that wrote `record`.
    pub(super) fn read(&mut self, record: &str) {
        if let Some(spent) = Spent::read(record) {
            self.before = spent;
        }
    }

    /// A record for later sessions, where there is a limit.
    pub(super) fn record(&self) -> Option<String> {
        self.limit.is_some().then(|| self.spent().text())
    }

    /// Counts a rendering; `seconds`: of all renderings of the session.
    pub(super) fn made_one(&mut self, seconds: f64) {
        self.made += 1;
        self.seconds = seconds;
    }

    /// Number of renderings made in this session, and their duration in seconds.
    pub(super) fn effort(&self) -> (usize, f64) {
        (self.made, self.seconds)
    }

    pub(super) fn is_limited(&self) -> bool {
        self.limit.is_some()
    }

    /// Whether `more` renderings will probably finish within `share` of the limit, by the duration of
    /// those before.
    pub(super) fn has_time(&self, more: usize, share: f64) -> bool {
        let Some(limit) = self.limit else { return true };
        let Spent { elapsed, rendering, made } = self.spent();
        let each = if made > 0 { rendering / made as f64 } else { 0.0 };
        elapsed + each * more as f64 <= share * limit.as_secs_f64()
    }

    fn spent(&self) -> Spent {
        Spent {
            elapsed: self.before.elapsed + self.started.elapsed().as_secs_f64(),
            rendering: self.before.rendering + self.seconds,
            made: self.before.made + self.made,
        }
    }
}

impl Spent {
    fn text(&self) -> String {
        let Self { elapsed, rendering, made } = self;
        format!("spent {elapsed} {rendering} {made}")
    }

    fn read(record: &str) -> Option<Self> {
        let mut words = record.strip_prefix("spent ")?.split(' ');
        let mut seconds =
            || words.next()?.parse().ok().filter(|it: &f64| it.is_finite() && *it >= 0.0);
        let (elapsed, rendering) = (seconds()?, seconds()?);
        Some(Self { elapsed, rendering, made: words.next()?.parse().ok()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_session_goes_on_with_the_time_and_the_pace_of_earlier_ones() {
        let mut first = Clock::start(Some(Duration::from_secs(100)));
        (0..10).for_each(|number| first.made_one(f64::from(number + 1)));
        let mut next = Clock::start(Some(Duration::from_secs(100)));
        next.read(&first.record().expect("limited"));
        // A second each.
        assert!(next.has_time(90, 1.0) && !next.has_time(101, 1.0) && !next.has_time(60, 0.5));
        assert_eq!(next.effort(), (0, 0.0), "of this session");
        next.read("spent 99.5 10 10");
        assert!(next.has_time(0, 1.0) && !next.has_time(1, 1.0));
        let free = Clock::start(None);
        assert!(free.has_time(usize::MAX, 0.0) && free.record().is_none());
    }

    #[test]
    fn records_survive_to_the_last_bit() {
        let spent = Spent { elapsed: 0.1 + 0.2, rendering: 1e-9, made: 7 };
        assert_eq!(Spent::read(&spent.text()), Some(spent));
        for record in ["spent 1 2", "spent 1 NaN 3", "spent -1 2 3", "spent 1 2 -3", "render"] {
            assert_eq!(Spent::read(record), None);
        }
    }
}

//! Shares the time that is left among the cameras that still need a search.

/// Share of the remaining time that the searches of a level may take beyond the least, where further levels may follow.
const LEVEL_SHARE: f64 = 0.5;

/// Time per evaluation, as measured so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    seconds: f64,
    evaluations: usize,
}

impl Pace {
    /// Counts a search's evaluations and the time that it took.
    pub(super) fn add(&mut self, evaluations: usize, seconds: f64) {
        self.evaluations += evaluations;
        self.seconds += seconds;
    }

    /// Evaluations that `seconds` hold; 0 before anything is measured.
    pub(super) fn within(&self, seconds: f64) -> usize {
        if self.seconds > 0.0 { (seconds.max(0.0) * self.evaluations as f64 / self.seconds) as usize } else { 0 }
    }

    /// Evaluations for the next of `cameras` cameras with `remaining` seconds left: at least 2.
    ///
    /// `least` is what each camera gets first, out of all the time there is, because a map needs all its cameras more than any of them needs a better
    /// frontier; more than that only out of this level's share, which is everything at the `last` level. Before anything is measured it is `least`.
    pub(super) fn allowance(&self, remaining: f64, cameras: usize, least: usize, last: bool) -> usize {
        if self.evaluations == 0 || self.seconds <= 0.0 {
            return least.max(2);
        }
        let evaluations = remaining.max(0.0) * self.evaluations as f64 / self.seconds / cameras.max(1) as f64;
        let share = if last { 1.0 } else { LEVEL_SHARE };
        // The casts saturate.
        ((evaluations * share) as usize).max(least.min(evaluations as usize)).max(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_comes_first_and_more_only_from_the_level_s_share() {
        let mut pace = Pace::default();
        assert_eq!(pace.allowance(1e9, 48, 24, true), 24, "nothing measured yet");
        pace.add(50, 10.0);
        // 240 s of 0.2 s are 1200 evaluations: 25 for each of 48 cameras.
        assert_eq!(pace.allowance(240.0, 48, 24, false), 24);
        assert_eq!(pace.allowance(240.0, 48, 24, true), 25);
        assert_eq!(pace.allowance(2400.0, 48, 24, false), 125);
        assert_eq!(pace.allowance(120.0, 48, 24, false), 12, "less than the least, the same for all");
        assert_eq!(pace.allowance(-1.0, 48, 24, false), 2);
        assert_eq!((pace.within(10.0), pace.within(-1.0), Pace::default().within(1e9)), (50, 0, 0));
    }
}

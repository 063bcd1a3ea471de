//! The exchange rate λ, in watts per unit of error, that spends a budget over its horizon.
//!
//! For a budget of a mean, one rate for all frames gives the least error: each takes the settings
//! with the least power + λ × error (Everett 1963). The rate is the greatest that keeps the budget
//! in every window of the horizon's length, by what the coming horizon is expected to cost:
//! model-predictive control (Rawlings, Mayne and Diehl 2017, "Model predictive control", chapter 1)
//! of one number. The expectation is the mean of the views so far.
//!
//! Under an error budget the roles swap: the least rate at which the expected error keeps it.

use std::sync::LazyLock;

use crate::frontier::{CostPoint, Frontier};

/// Rates of a [`Curve`]: from 10⁻² to 10⁷ watts per unit of error, eight a decade.
const RATES: usize = 73;
const FIRST_RATE: f64 = 1e-2;
const PER_DECADE: f64 = 8.0;
/// Parts of a horizon at whose ends windows are checked. More of them take longer; fewer let a window
/// between two ends exceed the budget by more.
const PARTS: usize = 60;
/// What windows may exceed a power budget by, as a share. Without it, views that come round in
/// another rhythm than the horizon leave power unused.
const TOLERANCE: f64 = 0.014;
/// Rate that is expected after the present settings, as a share of the present rate: the mean at
/// half the rate is nearly always affordable.
const LATER: f64 = 0.5;
/// Longest horizon, seconds: more energy than a battery holds.
const MAX_HORIZON: f64 = 86_400.0;
/// Longest frame that counts, seconds: a longer one is a pause.
const MAX_FRAME: f64 = 1.0;
/// What the frontier over all views counts for before the first view, seconds.
const PRIOR_SECONDS: f64 = 10.0;
/// Shortest time that settings are held, seconds: a frame of a slow app.
const MIN_HOLD: f64 = 0.1;
/// Shortest horizon, seconds; in a shorter one every frame keeps the limits.
pub(super) const MIN_HORIZON: f64 = 1.0;
/// Relative change of a limit from which it is another budget. What a battery or a meter says drifts.
const OTHER_LIMIT: f64 = 0.05;

/// Power and error of the best settings at each rate of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve([CostPoint; RATES]);

impl Default for Curve {
    fn default() -> Self {
        Self([CostPoint::new(0.0, 0.0); RATES])
    }
}

impl Curve {
    /// What `frontier` costs by rate, for a camera whose errors weigh `weight` times those of others.
    /// Zeros where the frontier is empty.
    pub fn of(frontier: &Frontier, weight: f64) -> Self {
        let points = frontier.points();
        let mut first = 0;
        Self(std::array::from_fn(|number| {
            let rate = GRID[number] * weight;
            let sum = |at: usize| points[at].cost.power.0 + rate * points[at].cost.error;
            // A greater rate never takes a cheaper point.
            for at in first + 1..points.len() {
                if sum(at) < sum(first) {
                    first = at;
                }
            }
            points.get(first).map_or(CostPoint::new(0.0, 0.0), |point| point.cost)
        }))
    }

    /// Adds what another camera costs at the same rates.
    pub fn add(&mut self, other: &Self) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            *own = CostPoint::new((own.power + other.power).0, own.error + other.error);
        }
    }

    /// Moves a `share` of the way to `other`.
    fn approach(&mut self, other: &Self, share: f64) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            let power = own.power.0 + share * (other.power.0 - own.power.0);
            *own = CostPoint::new(power, own.error + share * (other.error - own.error));
        }
    }

    /// The cost at a place of the grid, between whose numbers two settings take turns.
    fn at(&self, place: f64) -> CostPoint {
        let below = (place.max(0.0) as usize).min(RATES - 1);
        let above = (below + 1).min(RATES - 1);
        let (a, b, share) = (self.0[below], self.0[above], place - below as f64);
        let between = |a: f64, b: f64| a + share * (b - a);
        CostPoint::new(between(a.power.0, b.power.0), between(a.error, b.error))
    }
}

/// The rates of a [`Curve`], watts per unit of error.
static GRID: LazyLock<[f64; RATES]> = LazyLock::new(|| {
    std::array::from_fn(|number| FIRST_RATE * 10_f64.powf(number as f64 / PER_DECADE))
});

/// A limit of a mean, and how far a quantity is beyond it, now and at the ends of the horizon's parts.
#[derive(Clone, Debug, Default, PartialEq)]
struct Account {
    limit: f64,
    horizon: f64,
    /// Sum of (quantity − limit) × seconds.
    now: f64,
    /// The same at the ends of the last parts, the latest at `(count - 1) % PARTS`.
    past: Vec<f64>,
    count: usize,
    /// Seconds since the last end.
    since: f64,
}

impl Account {
    fn clear(&mut self) {
        (self.now, self.since, self.count) = (0.0, 0.0, 1);
        self.past.clear();
        self.past.resize(PARTS, 0.0);
    }

    /// Adds what was spent for `seconds`. Nothing where it or the limit is not finite.
    fn add(&mut self, quantity: f64, seconds: f64) {
        let (beyond, part) = (quantity - self.limit, self.horizon / PARTS as f64);
        if !beyond.is_finite() || self.past.is_empty() || self.horizon < MIN_HORIZON {
            return;
        }
        self.now += beyond * seconds;
        self.since += seconds;
        // A rounding error must not delay an end by a frame.
        while self.since >= part - 1e-9 {
            self.since -= part;
            self.past[self.count % PARTS] = self.now;
            self.count += 1;
            self.forget();
        }
        // The end of a part that has become shorter.
        self.since = self.since.max(0.0);
    }

    /// Forgets what was spent too much before the last horizon, but for a small share: a limit that could
    /// not be kept for long would else be followed by as long at the cheapest settings.
    fn forget(&mut self) {
        let oldest = self.past.iter().copied().fold(f64::INFINITY, f64::min);
        let beyond = (oldest - TOLERANCE * self.limit * self.horizon).max(0.0);
        self.now -= beyond;
        self.past.iter_mut().for_each(|past| *past -= beyond);
    }

    /// The windows of the horizon that began with the budget or later, in which a share of the limit may
    /// be exceeded: seconds until it ends, and by how much the sum may be beyond the limit's until then.
    fn windows(&self, tolerance: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let (part, tolerance) =
            (self.horizon / PARTS as f64, tolerance * self.limit * self.horizon);
        (1..=PARTS).filter_map(move |ahead| {
            let begun = (self.count - 1 + ahead).checked_sub(PARTS)?;
            let seconds = ahead as f64 * part - self.since;
            // What was spent beyond the budget once is not the measure of what comes.
            let begun = self.past[begun % PARTS].min(0.0);
            Some((seconds.max(1e-6), begun + tolerance - self.now))
        })
    }

    /// The most that may be spent for `hold` seconds, with `later` on average from then on, in every window.
    fn most(&self, hold: f64, later: f64, tolerance: f64) -> f64 {
        let most = self.windows(tolerance).map(|(seconds, room)| {
            let held = seconds.min(hold.max(MIN_HOLD));
            (room + self.limit * seconds - later * (seconds - held)) / held
        });
        most.fold(f64::INFINITY, f64::min)
    }

    /// The greatest mean from now on that keeps every window.
    fn greatest_mean(&self, tolerance: f64) -> f64 {
        let means = self.windows(tolerance).map(|(seconds, room)| self.limit + room / seconds);
        means.fold(f64::INFINITY, f64::min)
    }
}

/// What a rate tracker says of the next second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// λ, watts per unit of error: 0 takes the cheapest settings, infinity the best.
    pub watts_per_error: f64,
    /// The greatest power and error that may be held for the hold time; infinite where nothing limits
    /// them.
    pub most: CostPoint,
    /// Whether the error's limit decides, and not the power's.
    pub is_by_error: bool,
}

/// Steers the exchange rate of one camera, or of several with one budget. All watts are those of the
/// frontiers.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component))]
pub struct RateTracker {
    power: Account,
    error: Account,
    /// What the views so far cost, on average over a horizon.
    mean: Curve,
    /// Seconds that the mean is of; 0 before the first view.
    seen: f64,
    /// The limits as they were given, in the watts of the app's meter.
    given: (Option<f64>, Option<f64>, f64),
    rate: f64,
}

impl RateTracker {
    /// λ of the last frame, in watts per unit of error; 0 before the first.
    pub fn watts_per_error(&self) -> f64 {
        self.rate
    }

    /// Expects the views to cost what `overall` says, until some have been seen.
    pub fn expect(&mut self, overall: &Frontier) {
        if self.seen == 0.0 && !overall.is_empty() {
            (self.mean, self.seen) = (Curve::of(overall, 1.0), PRIOR_SECONDS);
        }
    }

    /// Whether the horizon is too short for a mean.
    pub fn is_instant(&self) -> bool {
        self.given.2 < MIN_HORIZON
    }

    /// Forgets what was spent, where limits are others than before: of power in the watts of the app's
    /// meter, and of error; `horizon` in seconds. Returns whether they are.
    pub fn begin(&mut self, power: Option<f64>, error: Option<f64>, horizon: f64) -> bool {
        let (old_power, old_error, old_horizon) = self.given;
        let is_other =
            differs(power, old_power) || differs(error, old_error) || horizon != old_horizon;
        if is_other || self.power.past.is_empty() {
            self.given = (power, error, horizon);
            self.power.clear();
            self.error.clear();
        }
        is_other
    }

    /// Adds what the last frame of `seconds` cost: of settings that were applied.
    pub fn spend(&mut self, cost: CostPoint, seconds: f64) {
        let seconds = if seconds > 0.0 { seconds.min(MAX_FRAME) } else { return };
        self.power.add(cost.power.0, seconds);
        self.error.add(cost.error, seconds);
    }

    /// The rate for the next frame, `seconds` after the last, in a view of the costs `view`, under limits
    /// of the mean `power` and of the mean `error` in the frontiers' terms. `hold`: how long settings are
    /// held, seconds.
    pub fn rate(
        &mut self,
        view: &Curve,
        power: Option<f64>,
        error: Option<f64>,
        hold: f64,
        seconds: f64,
    ) -> Rate {
        let horizon = self.given.2.clamp(0.0, MAX_HORIZON);
        let finite = |limit: Option<f64>| limit.filter(|limit| limit.is_finite());
        for (account, limit) in [(&mut self.power, power), (&mut self.error, error)] {
            (account.limit, account.horizon) = (finite(limit).unwrap_or(f64::INFINITY), horizon);
        }
        self.see(view, seconds, horizon);
        let last = (RATES - 1) as f64;
        let mean = &self.mean;
        let by_power = finite(power).map(|_| {
            let most = self.power.greatest_mean(TOLERANCE);
            greatest(|place| mean.at(place).power.0 <= most)
        });
        let by_error = finite(error).map(|_| {
            let most = self.error.greatest_mean(0.0);
            // The least rate: from the far end of the grid.
            greatest(|from_end| mean.at(last - from_end).error <= most)
                .map_or(last, |from_end| last - from_end)
        });
        // Neither: the best settings; an infinite error limit: the cheapest.
        let is_by_error = match (by_power, by_error) {
            (None, None) => error.is_some(),
            (Some(_), None) => false,
            (None, Some(_)) => true,
            (Some(power), Some(error)) => power.is_some_and(|power| error <= power),
        };
        let place = match (is_by_error, by_power) {
            (true, _) => by_error.filter(|place| *place > 0.0),
            (false, Some(place)) => place,
            (false, None) => Some(last),
        };
        self.rate = match place {
            None => 0.0,
            Some(place) if place >= last => f64::INFINITY,
            // Of two settings that take turns the one that spends more, as long as the budget can bear
            // it: at a rate between them neither is worth a switch, and the budget stays unspent.
            Some(place) if is_by_error => GRID[place.floor() as usize],
            Some(place) => GRID[place.ceil() as usize],
        };
        let later = |share: f64| {
            mean.at((place.unwrap_or(0.0) + PER_DECADE * share.log10()).clamp(0.0, last))
        };
        let most_power = finite(power).map_or(f64::INFINITY, |limit| {
            self.power.most(hold, later(LATER).power.0.min(limit), TOLERANCE)
        });
        let most_error = finite(error).map_or(f64::INFINITY, |limit| {
            self.error.most(hold, later(LATER.recip()).error.min(limit), 0.0)
        });
        let most = CostPoint::new(most_power, if is_by_error { most_error } else { f64::INFINITY });
        Rate { watts_per_error: self.rate, most, is_by_error }
    }

    /// Averages what views cost over a horizon.
    fn see(&mut self, view: &Curve, seconds: f64, horizon: f64) {
        let seconds = if seconds > 0.0 { seconds.min(MAX_FRAME) } else { 0.0 };
        self.seen = (self.seen + seconds).min(horizon.max(MIN_HORIZON));
        self.mean.approach(view, if self.seen > 0.0 { seconds / self.seen } else { 1.0 });
    }
}

/// The greatest place of the grid that is accepted, as all below are; `None` where none is.
fn greatest(is_accepted: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut low, mut high) = (0.0, (RATES - 1) as f64);
    if !is_accepted(low) {
        return None;
    }
    if is_accepted(high) {
        return Some(high);
    }
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if is_accepted(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

fn differs(now: Option<f64>, then: Option<f64>) -> bool {
    match (now, then) {
        (Some(now), Some(then)) => {
            // Equal infinities do not differ. NaN, for which nothing is near, does, as does what is as far
            // from infinity as its share.
            let is_near = (now - then).abs() < OTHER_LIMIT * then.abs();
            now != then && !is_near
        }
        (now, then) => now.is_some() != then.is_some(),
    }
}

#[cfg(test)]
#[path = "rate_tests.rs"]
mod tests;

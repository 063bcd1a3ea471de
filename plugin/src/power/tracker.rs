//! The fault model of every meter: power over time from readings that may fall, stand still, jump,
//! sleep or fail. Has no threads and no clock, so that tests can inject every fault.
//!
//! Readings become *pieces*, energy over a time. A piece far above the recent power waits for the
//! pieces after it: a load stays, a counter that jumped does not. The energy of a time with a fault
//! is never counted.

use std::time::Duration;

use bevy::reflect::Reflect;

use crate::power::meter::least_window;
use crate::power::{Count, MeterError, MeterInfo, PowerMeter, Provenance, Reading};
use crate::units::{Joules, Watts};

/// Largest plausible power of one machine that renders, watts.
const MAX_WATTS: f64 = 5_000.0;
/// A piece waits if it is above the recent power by more than this factor and these watts.
const RISE: f64 = 2.0;
const RISE_WATTS: f64 = 1.0;
/// Pieces in succession above that, the first included, which make a load.
const PIECES_OF_A_LOAD: usize = 3;
/// Their length where a sensor tells them: a false value stays for some readings, where a false
/// count is in one piece. At least the meter's window.
const LOAD_SECONDS: f64 = 1.0;
/// A high piece and the next are one that was read late if their mean is above the recent power by no
/// more than this factor.
const LATE: f64 = 1.25;
/// The recent power falls with this time constant, seconds.
const RECENT_SECONDS: f64 = 2.0;
/// Lone high pieces that recur without a fall of the counter are bursts of load from this many on,
/// where one counts for this many seconds.
const BURSTS_OF_A_LOAD: f64 = 3.0;
const BURST_SECONDS: f64 = 8.0;
/// Shortest piece that is judged, seconds; of less, power is mostly the counter's steps.
const MIN_PIECE: Duration = Duration::from_millis(90);
/// Ratio of the powers after and before a wrap. A reset, too, lets a counter fall; what it then seems
/// to have counted is rarely near the power before.
const WRAP_RATIO: f64 = 2.0;
/// Dropped intervals in succession after which the meter is lost.
const DROPS_IN_SUCCESSION: u32 = 3;
/// Time without an increase after which a counter counts as stuck; the longer of this and
/// `STUCK_WINDOWS` windows. Drivers update more slowly than they say.
const STUCK_AFTER: Duration = Duration::from_secs(10);
const STUCK_WINDOWS: u32 = 10;
/// Time without a sign of life after which a sensor counts as stuck. Batteries have new values every
/// minute at the latest.
const LIFELESS_AFTER: Duration = Duration::from_secs(120);
/// Time by which clocks must disagree to tell a sleep; less is the time between reading them.
const MIN_SLEEP: Duration = Duration::from_millis(500);
/// Shortest time without a reading that tells a sleep where the clock runs on.
const MIN_GAP: Duration = Duration::from_secs(5);

/// Whether the metered power is known.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
#[non_exhaustive]
pub enum MeterState {
    /// The meter is being opened, or the first interval has not ended, also after a sleep.
    #[default]
    Starting,
    /// Valid readings arrive.
    Running,
    /// Readings stopped arriving, or became invalid. Polling continues; the state returns to
    /// `Running` with valid readings.
    Lost {
        /// The meter's error or fault.
        reason: String,
    },
    /// No meter is open. Unless metering is off, opening one is tried again.
    Unavailable {
        /// Why there is no meter.
        reason: String,
    },
}

/// A moment on a clock that may stand still while the machine sleeps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moment {
    /// Time since a fixed moment.
    pub clock: Duration,
    /// Time by which a clock that runs on in sleep is ahead; grows with each sleep.
    pub slept: Duration,
}

/// Figures of a meter at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PowerSnapshot {
    /// The meter, once it is open.
    pub info: Option<MeterInfo>,
    /// Whether the power is known.
    pub state: MeterState,
    /// Mean power over the last interval, in watts; finite, at least 0. `None` unless the state is
    /// `Running`.
    pub latest: Option<Watts>,
    /// Exponential mean of `latest`, in watts; finite, at least 0. `None` unless the state is
    /// `Running`.
    pub mean: Option<Watts>,
    /// Length of the interval of `latest`. `None` unless the state is `Running`.
    pub interval: Option<Duration>,
    /// Time of the reading that ends the interval, since the sampler's start. `None` unless the
    /// state is `Running`.
    pub at: Option<Duration>,
    /// Number of valid intervals.
    pub sample_count: u64,
    /// Number of pieces dropped because the counter fell or jumped, or time went backwards.
    pub dropped_count: u64,
    /// Why the last dropped piece was dropped.
    pub note: Option<String>,
    /// Energy of all valid pieces so far, and their length. The quotient of two differences is a mean
    /// power, whatever was dropped between.
    pub counted: (Joules, Duration),
}

impl PowerSnapshot {
    /// Sets the state and clears the power figures.
    pub(crate) fn lose(&mut self, state: MeterState) {
        self.state = state;
        self.latest = None;
        self.mean = None;
        self.interval = None;
        self.at = None;
    }
}

/// Energy over a time.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    joules: f64,
    seconds: f64,
}

impl Piece {
    fn watts(self) -> f64 {
        self.joules / self.seconds
    }

    fn and(self, other: Self) -> Self {
        Self { joules: self.joules + other.joules, seconds: self.seconds + other.seconds }
    }
}

/// What the next piece begins with.
#[derive(Debug)]
enum Base {
    Counters {
        counts: Vec<Count>,
        at: Duration,
        /// The last value of each, and the time since when it is so.
        seen: Vec<(Joules, Duration)>,
        is_stuck: bool,
    },
    Power {
        watts: f64,
        at: Duration,
    },
}

/// Why a reading makes no piece.
enum Fault {
    /// The time up to here is not counted.
    Dropped(String),
    Lost(MeterError),
}

/// Fault of a counter that stands still for that long.
pub(crate) fn did_not_move(after: Duration) -> String {
    format!("the counter did not move in {:.0} s", after.as_secs_f64())
}

/// Computes power from a meter's readings.
#[derive(Debug)]
pub(crate) struct PowerTracker {
    name: String,
    window: Duration,
    /// Shortest piece.
    least: Duration,
    smoothing: Duration,
    /// Longest time between two readings that is no sleep.
    gap: Duration,
    /// A model is right about every jump: it counts what happens.
    believes_jumps: bool,
    last: Option<Moment>,
    base: Option<Base>,
    /// A sign of life, and since when it is the same.
    life: Option<(u64, Duration)>,
    /// The recent power, watts, and whether it is only that of a first piece, whose begin is not
    /// known.
    recent: Option<(f64, bool)>,
    pending: Vec<Piece>,
    /// Lone high pieces of late, and when they were counted.
    bursts: (f64, Duration),
    /// The interval that has not ended.
    open: Piece,
    drops_in_succession: u32,
    snapshot: PowerSnapshot,
}

impl PowerTracker {
    /// For readings of `meter` every `poll`; `smoothing`: time constant of the mean.
    pub(crate) fn new(meter: &dyn PowerMeter, poll: Duration, smoothing: Duration) -> Self {
        let (info, window) = (meter.info(), least_window(meter));
        Self {
            name: info.name.clone(),
            window,
            least: window.min(MIN_PIECE),
            smoothing,
            gap: MIN_GAP.max(poll.saturating_mul(4)),
            believes_jumps: info.provenance == Provenance::Modelled,
            last: None,
            base: None,
            life: None,
            recent: None,
            pending: Vec::new(),
            bursts: (0.0, Duration::ZERO),
            open: Piece::default(),
            drops_in_succession: 0,
            snapshot: PowerSnapshot { info: Some(info), ..PowerSnapshot::default() },
        }
    }

    /// The current figures.
    pub(crate) fn snapshot(&self) -> &PowerSnapshot {
        &self.snapshot
    }

    /// Whether more readings are needed before one says something.
    pub(crate) fn is_settling(&self) -> bool {
        self.recent.is_none_or(|(_, is_first)| is_first) || !self.pending.is_empty()
    }

    /// Adds the meter's answer at a moment.
    pub(crate) fn push(&mut self, answer: Result<Reading, MeterError>, now: Moment) {
        if let Some(last) = self.last.replace(now) {
            match now.clock.checked_sub(last.clock) {
                None => {
                    self.restart();
                    self.drop_piece("time went backwards".to_owned());
                }
                Some(gap) if gap > self.gap || now.slept > last.slept + MIN_SLEEP => {
                    // The machine slept. What it drew is nobody's power, and the last figures are
                    // those of another time.
                    self.restart();
                    self.life = None;
                    if self.snapshot.state == MeterState::Running {
                        self.snapshot.lose(MeterState::Starting);
                    }
                }
                Some(_) => {}
            }
        }
        let piece = answer.map_err(Fault::Lost).and_then(|reading| match reading {
            Reading::Energy(counts) => self.count(counts, now.clock),
            Reading::Power { power, sign_of_life } => {
                self.integrate(power.0, sign_of_life, now.clock)
            }
        });
        match piece {
            Ok(Some(piece)) => self.judge(piece, now.clock),
            Ok(None) => {}
            Err(Fault::Dropped(note)) => {
                self.bursts.0 = 0.0;
                self.drop_piece(note);
            }
            Err(Fault::Lost(error)) => {
                self.restart_unless_stuck();
                self.snapshot.lose(MeterState::Lost { reason: error.to_string() });
            }
        }
    }

    fn broken(&self, reason: String) -> Fault {
        Fault::Lost(MeterError::broken(self.name.as_str(), reason))
    }

    /// Forgets what pieces are made of and compared with.
    fn restart(&mut self) {
        self.base = None;
        self.recent = None;
        self.pending.clear();
        self.open = Piece::default();
    }

    /// The same, but a stuck counter is still known when it moves.
    fn restart_unless_stuck(&mut self) {
        let base = self.base.take();
        self.restart();
        self.base = base.filter(|base| matches!(base, Base::Counters { is_stuck: true, .. }));
    }

    /// The piece up to these values of counters.
    fn count(&mut self, counts: Vec<Count>, at: Duration) -> Result<Option<Piece>, Fault> {
        if let Some(odd) = counts.iter().find(|count| !count.energy.0.is_finite()) {
            return Err(self.broken(format!("the counter reads {} J", odd.energy.0)));
        }
        let stuck_after = STUCK_AFTER.max(self.window.saturating_mul(STUCK_WINDOWS));
        let Some(Base::Counters { counts: before, at: since, seen, is_stuck }) = &mut self.base
        else {
            self.base = Some(counters(counts, at));
            return Ok(None);
        };
        if before.len() != counts.len() {
            self.base = Some(counters(counts, at));
            return Err(Fault::Dropped("another counter takes part".to_owned()));
        }
        for (count, seen) in counts.iter().zip(seen.iter_mut()) {
            if count.energy != seen.0 {
                *seen = (count.energy, at);
            }
        }
        if seen.iter().any(|(_, since)| at.saturating_sub(*since) >= stuck_after) {
            *is_stuck = true;
            return Err(self.broken(did_not_move(stuck_after)));
        }
        let elapsed = at - *since;
        if *is_stuck {
            // The first increase after a standstill may include the energy of all of it.
            self.base = Some(counters(counts, at));
            return Ok(None);
        }
        let (mut rise, mut wrap) = (0.0, None);
        for (before, count) in before.iter().zip(&counts) {
            let (mut from, to) = (before.energy, count.energy);
            if to < from {
                let fault =
                    Fault::Dropped(format!("the counter fell from {} J to {} J", from.0, to.0));
                match count.range {
                    Some(range) if from <= range => from = from - range,
                    _ => {
                        self.base = Some(counters(counts, at));
                        return Err(fault);
                    }
                }
                wrap = Some(fault);
            }
            rise += (to - from).0;
        }
        if rise == 0.0 || elapsed.is_zero() || elapsed < self.least {
            return Ok(None);
        }
        let piece = Piece { joules: rise, seconds: elapsed.as_secs_f64() };
        let seen = std::mem::take(seen);
        self.base = Some(Base::Counters { counts, at, seen, is_stuck: false });
        let is_wrap = |recent: f64| {
            piece.watts() <= recent * WRAP_RATIO && piece.watts() * WRAP_RATIO >= recent
        };
        match wrap {
            Some(fault) if !self.recent.is_some_and(|(recent, _)| is_wrap(recent)) => Err(fault),
            _ => Ok(Some(piece)),
        }
    }

    /// The piece up to this power, by the trapezoidal rule.
    fn integrate(
        &mut self,
        watts: f64,
        life: Option<u64>,
        at: Duration,
    ) -> Result<Option<Piece>, Fault> {
        if watts == 0.0 {
            return Err(self.broken("it reads 0 W, which no machine draws that renders".to_owned()));
        }
        // Also rejects NaN.
        if !(watts > 0.0 && watts <= MAX_WATTS) {
            return Err(self.broken(format!("it reads {watts} W")));
        }
        if let Some(life) = life {
            match self.life {
                Some((same, since)) if same == life && at >= since => {
                    if at - since >= LIFELESS_AFTER {
                        let seconds = LIFELESS_AFTER.as_secs_f64();
                        let reason = format!("its files say the same for {seconds:.0} s");
                        return Err(self.broken(reason));
                    }
                }
                _ => self.life = Some((life, at)),
            }
        }
        let base = self.base.replace(Base::Power { watts, at });
        let Some(Base::Power { watts: before, at: since }) = base else { return Ok(None) };
        let seconds = (at - since).as_secs_f64();
        let piece = Piece { joules: (before + watts) * 0.5 * seconds, seconds };
        Ok((seconds > 0.0).then_some(piece))
    }

    /// Counts a piece, or lets it wait, or drops it.
    fn judge(&mut self, piece: Piece, at: Duration) {
        let watts = piece.watts();
        // Also rejects a difference that overflowed.
        if !(0.0..=MAX_WATTS).contains(&watts) {
            return self.drop_piece(format!("the counter jumped by {} J", piece.joules));
        }
        let Some((recent, _)) = self.recent else {
            // It is not known how old the first value was, and so the time of its piece.
            self.recent = Some((watts, true));
            if self.believes_jumps {
                self.accept(piece, at);
            }
            return;
        };
        let is_load = |piece: Piece| piece.watts() <= RISE * recent + RISE_WATTS;
        if self.believes_jumps {
            self.accept(piece, at);
        } else if is_load(piece) {
            match std::mem::take(&mut self.pending)[..] {
                [] => self.accept(piece, at),
                // A late reading takes from one piece what it gives to the next.
                [high] if high.and(piece).watts() <= LATE * recent => {
                    self.accept(high.and(piece), at);
                }
                [high, ..] if self.is_burst(at) => {
                    self.recent = Some((high.watts(), false));
                    self.accept(high.and(piece), at);
                }
                [high, ..] => {
                    self.drop_piece(format!("the counter jumped by {} J", high.joules));
                    self.accept(piece, at);
                }
            }
        } else {
            self.pending.push(piece);
            let seconds: f64 = self.pending.iter().map(|piece| piece.seconds).sum();
            let is_long = matches!(self.base, Some(Base::Counters { .. }))
                || seconds >= LOAD_SECONDS.max(self.window.as_secs_f64()) * 0.9;
            if self.pending.len() >= PIECES_OF_A_LOAD && is_long {
                let pending = std::mem::take(&mut self.pending);
                let least = pending.iter().map(|piece| piece.watts()).fold(f64::MAX, f64::min);
                self.recent = Some((least, false));
                self.open = Piece::default();
                // The load began somewhere in the first one.
                for piece in pending.into_iter().skip(1) {
                    if piece.watts() <= RISE * least + RISE_WATTS {
                        self.accept(piece, at);
                    }
                }
            }
        }
    }

    /// Counts a lone high piece. Whether so many come that they are bursts of load.
    fn is_burst(&mut self, at: Duration) -> bool {
        let (count, since) = self.bursts;
        let passed = at.saturating_sub(since).as_secs_f64();
        self.bursts = (count * (-passed / BURST_SECONDS).exp() + 1.0, at);
        self.bursts.0 >= BURSTS_OF_A_LOAD
    }

    fn accept(&mut self, piece: Piece, at: Duration) {
        let faded = match self.recent {
            Some((recent, false)) => recent * (-piece.seconds / RECENT_SECONDS).exp(),
            _ => 0.0,
        };
        self.recent = Some((piece.watts().max(faded), false));
        self.drops_in_succession = 0;
        if let MeterState::Lost { .. } = self.snapshot.state {
            self.snapshot.state = MeterState::Starting;
        }
        let (energy, length) = self.snapshot.counted;
        let more = Duration::from_secs_f64(piece.seconds);
        self.snapshot.counted = (energy + Joules(piece.joules), length + more);
        self.open = self.open.and(piece);
        // Timers are slightly late or early: an interval a tenth shorter than the window counts.
        if self.open.seconds >= 0.9 * self.window.as_secs_f64() {
            let interval = std::mem::take(&mut self.open);
            self.publish(Watts(interval.watts()), interval.seconds, at);
        }
    }

    fn publish(&mut self, power: Watts, seconds: f64, at: Duration) {
        let snapshot = &mut self.snapshot;
        snapshot.mean = Some(match snapshot.mean {
            // An interval's weight depends on its length relative to the time constant, so that the
            // mean is independent of the polling rate.
            Some(mean) if !self.smoothing.is_zero() => {
                let weight = -(-seconds / self.smoothing.as_secs_f64()).exp_m1();
                mean + (power - mean) * weight
            }
            _ => power,
        });
        snapshot.latest = Some(power);
        snapshot.interval = Some(Duration::from_secs_f64(seconds));
        snapshot.at = Some(at);
        snapshot.state = MeterState::Running;
        snapshot.sample_count += 1;
    }

    /// Drops what was read since the last valid piece.
    fn drop_piece(&mut self, note: String) {
        self.pending.clear();
        self.open = Piece::default();
        self.snapshot.dropped_count += 1;
        self.drops_in_succession += 1;
        if self.drops_in_succession >= DROPS_IN_SUCCESSION {
            // The figures are out of date, and the counter is unusable.
            let reason =
                format!("{DROPS_IN_SUCCESSION} intervals in succession were invalid: {note}");
            let reason = MeterError::broken(self.name.as_str(), reason).to_string();
            self.snapshot.lose(MeterState::Lost { reason });
        }
        self.snapshot.note = Some(note);
    }
}

fn counters(counts: Vec<Count>, at: Duration) -> Base {
    let seen = counts.iter().map(|count| (count.energy, at)).collect();
    Base::Counters { counts, at, seen, is_stuck: false }
}

#[cfg(test)]
#[path = "tracker_tests.rs"]
mod tests;

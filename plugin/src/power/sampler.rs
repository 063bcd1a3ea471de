//! Samples a meter on a thread of its own, since a reading may take milliseconds and a driver may
//! hang.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

// The standard one panics in a browser.
use bevy::platform::time::Instant;

use crate::power::meter::least_window;
use crate::power::tracker::{Moment, PowerTracker};
use crate::power::{MeterError, MeterState, OpenMeterError, PowerMeter, PowerSnapshot};

/// Shortest time between an app's readings. Faster polling costs more power than the extra readings
/// are worth.
const MIN_INTERVAL: Duration = Duration::from_millis(50);
/// Time between readings of a measurement, which sees each step of a counter.
const FINE_INTERVAL: Duration = Duration::from_millis(5);
/// Time between readings of a meter that fails, at least.
const LOST_INTERVAL: Duration = Duration::from_secs(1);

/// Time without an answer, beyond the time between readings, after which a meter counts as hung, and
/// the same of one that is being opened: each may take seconds until its counter moves.
const HANG_TIMEOUT: Duration = Duration::from_secs(2);
const OPEN_TIMEOUT: Duration = Duration::from_secs(45);

/// Time until a meter that could not be opened is tried again. It doubles with each trial of one that
/// is not there, as looking for it takes power, up to the second.
const FIRST_REOPENING: Duration = Duration::from_millis(if cfg!(test) { 20 } else { 5_000 });
const LAST_REOPENING: Duration = Duration::from_secs(40);

/// Timeout for joining the sampling thread. A thread that hangs in a driver is detached, so that
/// the app does not hang too.
const JOIN_TIMEOUT: Duration = Duration::from_millis(500);

/// Sampling interval and smoothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerSettings {
    /// Time between readings; at least the meter's own window and 0.05 s, shorter values are
    /// raised. Higher values cost less power and give smoother figures; lower values follow changes
    /// sooner and cost more power. Default: 0.25 s.
    pub interval: Duration,
    /// Time constant of the exponential mean. Higher values give a steadier mean; lower values
    /// follow changes sooner; 0 s disables smoothing. Default: 2 s.
    pub smoothing: Duration,
}

impl Default for SamplerSettings {
    fn default() -> Self {
        Self { interval: Duration::from_millis(250), smoothing: Duration::from_secs(2) }
    }
}

/// State shared by the sampling thread.
#[derive(Debug)]
struct Published {
    /// The fixed moment that times of the snapshot count from.
    origin: Instant,
    snapshot: PowerSnapshot,
    /// Longest time until the next update that is no hang.
    patience: Duration,
    /// Increases with every poll.
    revision: u64,
    /// Time of the thread's last update.
    at: Instant,
}

/// Samples a meter in the background and judges its readings. Stops when dropped; waits at most
/// 0.5 s for its thread.
///
/// A failed meter is still read, so that it recovers after an unplugged charger or a driver's
/// restart.
#[derive(Debug)]
pub struct PowerSampler {
    published: Arc<Mutex<Published>>,
    /// Dropped to stop the thread.
    stop: Option<mpsc::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl PowerSampler {
    /// Samples an open meter every 5 ms, or where it tells a power every
    /// [`poll_seconds`](PowerMeter::poll_seconds): for a measurement, whose
    /// [`counted`](PowerSnapshot::counted) energy goes from step to step of the counter.
    ///
    /// # Errors
    /// [`MeterError::Unavailable`] when the thread cannot be created.
    pub fn fine(meter: Box<dyn PowerMeter>) -> Result<Self, MeterError> {
        let settings = SamplerSettings { interval: FINE_INTERVAL, smoothing: Duration::ZERO };
        let mut meter = Some(meter);
        let open = move || {
            meter.take().ok_or_else(|| MeterError::unavailable("sampler", "it was opened").into())
        };
        Self::start(open, settings, true)
    }

    /// Opens a meter on the sampling thread, which may block, and starts to sample it. When `open`
    /// fails, the state becomes [`MeterState::Unavailable`] with the reason, and it is tried again
    /// later: a battery meters a laptop only once its charger is unplugged.
    ///
    /// # Errors
    /// [`MeterError::Unavailable`] when the thread cannot be created.
    pub(crate) fn start(
        mut open: impl FnMut() -> Result<Box<dyn PowerMeter>, OpenMeterError> + Send + 'static,
        settings: SamplerSettings,
        is_fine: bool,
    ) -> Result<Self, MeterError> {
        let origin = Instant::now();
        let published = Arc::new(Mutex::new(Published {
            origin,
            snapshot: PowerSnapshot::default(),
            patience: OPEN_TIMEOUT,
            revision: 0,
            at: origin,
        }));
        let (stop, stopped) = mpsc::channel();
        let shared = Arc::clone(&published);
        let thread = thread::Builder::new()
            .name("frugal-gi-power".to_owned())
            .spawn(move || {
                let mut wait = FIRST_REOPENING;
                loop {
                    match open() {
                        Ok(meter) => return poll(meter, settings, is_fine, &shared, &stopped),
                        Err(error) => {
                            // It is there, and may answer at any time.
                            if let OpenMeterError::Meter(MeterError::Unreadable { .. }) = error {
                                wait = FIRST_REOPENING;
                            }
                            refuse(&shared, error.to_string());
                        }
                    }
                    if stopped.recv_timeout(wait) != Err(mpsc::RecvTimeoutError::Timeout) {
                        return;
                    }
                    wait = (wait * 2).min(LAST_REOPENING);
                }
            })
            .map_err(|error| {
                MeterError::unavailable(
                    "sampler",
                    format!("the sampling thread cannot be created: {error}"),
                )
            })?;
        Ok(Self { published, stop: Some(stop), thread: Some(thread) })
    }

    /// The current figures. Never waits for the meter.
    pub fn snapshot(&self) -> PowerSnapshot {
        let published = lock(&self.published);
        self.with_fault(&published)
    }

    /// The current figures if they changed since the call that wrote `seen`. Does not allocate
    /// otherwise, so that it can be called every frame.
    pub(crate) fn snapshot_if_changed(
        &self,
        seen: &mut Option<(u64, bool)>,
    ) -> Option<PowerSnapshot> {
        let published = lock(&self.published);
        let current = Some((published.revision, self.fault(&published).is_some()));
        if *seen == current {
            return None;
        }
        *seen = current;
        Some(self.with_fault(&published))
    }

    /// When the reading of a snapshot was taken; `None` while the power is unknown.
    pub(crate) fn read_at(&self, snapshot: &PowerSnapshot) -> Option<Instant> {
        snapshot.at.map(|at| lock(&self.published).origin + at)
    }

    fn with_fault(&self, published: &Published) -> PowerSnapshot {
        let mut snapshot = published.snapshot.clone();
        if let Some(reason) = self.fault(published) {
            snapshot.lose(MeterState::Lost { reason });
        }
        snapshot
    }

    /// A fault of the thread itself, which the thread cannot report.
    fn fault(&self, published: &Published) -> Option<String> {
        if matches!(published.snapshot.state, MeterState::Unavailable { .. }) {
            return None;
        }
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return Some("the meter panicked".to_owned());
        }
        // Reports the limit and not the elapsed time, which would change the reason at every call.
        let timeout = published.patience;
        (published.at.elapsed() > timeout)
            .then(|| format!("the meter has not answered for {:.0} s", timeout.as_secs_f64()))
    }
}

impl Drop for PowerSampler {
    fn drop(&mut self) {
        drop(self.stop.take());
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() && start.elapsed() < JOIN_TIMEOUT {
            thread::sleep(Duration::from_millis(1));
        }
        if thread.is_finished() {
            // A panic in a meter was already reported by its own message and by the state.
            let _ = thread.join();
        }
    }
}

fn lock(published: &Mutex<Published>) -> MutexGuard<'_, Published> {
    // Each update leaves consistent figures, so a poisoned lock is safe to read.
    published.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says why there is no meter. The same reason is said once.
fn refuse(published: &Mutex<Published>, reason: String) {
    let mut published = lock(published);
    let state = MeterState::Unavailable { reason };
    if published.snapshot.state != state {
        published.snapshot.lose(state);
        published.revision += 1;
    }
}

/// Polls until the sampler is dropped.
fn poll(
    mut meter: Box<dyn PowerMeter>,
    settings: SamplerSettings,
    is_fine: bool,
    published: &Mutex<Published>,
    stopped: &mpsc::Receiver<()>,
) {
    let window = least_window(meter.as_ref());
    let interval = settings.interval.max(if is_fine { FINE_INTERVAL } else { MIN_INTERVAL });
    // A power is read at its own rate, a counter once in a window.
    let least = meter.poll_seconds().max(MIN_INTERVAL.as_secs_f64());
    let (interval, settling) = match Duration::try_from_secs_f64(least) {
        Ok(least) => (interval.max(window).min(least), least),
        Err(_) if is_fine => (interval, interval),
        Err(_) => (interval.max(window), interval.min(MIN_INTERVAL.max(window / 4))),
    };
    let mut tracker = PowerTracker::new(meter.as_ref(), interval, settings.smoothing);
    // What is counted before a sleep is no matter: sleeps are told by changes.
    let clock = Clock::since(lock(published).origin);
    loop {
        let before = clock.now();
        let answer = meter.read();
        let after = clock.now();
        // The midpoint of the call: a driver may take milliseconds to answer.
        let at = before.clock + (after.clock - before.clock) / 2;
        let has_failed = answer.is_err();
        tracker.push(answer, Moment { clock: at, slept: after.slept });
        let wait = match tracker.is_settling() {
            _ if has_failed => interval.max(LOST_INTERVAL),
            true => interval.min(settling),
            false => interval,
        };
        {
            let mut published = lock(published);
            published.snapshot.clone_from(tracker.snapshot());
            published.patience = wait.saturating_add(HANG_TIMEOUT);
            published.revision += 1;
            published.at = Instant::now();
        }
        match stopped.recv_timeout(wait) {
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Ok(()) | Err(mpsc::RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// A clock that tells sleep.
pub(crate) struct Clock {
    origin: Instant,
    /// Of a clock that runs on in sleep.
    started: Option<Duration>,
}

impl Clock {
    /// A clock that counts from `origin`, which is about now.
    pub(crate) fn since(origin: Instant) -> Self {
        Self { origin, started: running_on() }
    }

    /// The time since the origin.
    pub(crate) fn now(&self) -> Moment {
        let clock = self.origin.elapsed();
        let all = running_on().zip(self.started).map(|(now, started)| now.saturating_sub(started));
        Moment { clock, slept: all.map_or(Duration::ZERO, |all| all.saturating_sub(clock)) }
    }
}

/// A clock that runs on while the machine sleeps, where the other one stands still: that of
/// `Instant` does on Linux and Apple's systems.
#[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
fn running_on() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};
    #[cfg(any(target_os = "linux", target_os = "android"))]
    let clock = ClockId::Boottime;
    #[cfg(target_vendor = "apple")]
    let clock = ClockId::Monotonic;
    let time = clock_gettime(clock);
    let nanoseconds = u32::try_from(time.tv_nsec).unwrap_or_default();
    Some(Duration::new(u64::try_from(time.tv_sec).unwrap_or_default(), nanoseconds))
}

/// Elsewhere the clock runs on, and the time without a reading tells a sleep.
#[cfg(not(any(target_os = "linux", target_os = "android", target_vendor = "apple")))]
fn running_on() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::{MeterInfo, Provenance, ScriptedMeter};
    use crate::units::Joules;

    const QUICK: SamplerSettings =
        SamplerSettings { interval: Duration::from_millis(50), smoothing: Duration::from_secs(1) };

    /// Waits until the snapshot meets the condition. Fails after 20 s, enough even for a busy
    /// machine.
    fn wait_for(
        sampler: &PowerSampler,
        what: &str,
        is_so: impl Fn(&PowerSnapshot) -> bool,
    ) -> PowerSnapshot {
        let start = Instant::now();
        loop {
            let snapshot = sampler.snapshot();
            if is_so(&snapshot) {
                return snapshot;
            }
            assert!(start.elapsed() < Duration::from_secs(20), "no {what}: {snapshot:?}");
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Samples an open meter.
    fn sampler_of(meter: impl PowerMeter + 'static, settings: SamplerSettings) -> PowerSampler {
        let mut meter = Some(Box::new(meter) as Box<dyn PowerMeter>);
        let open = move || Ok(meter.take().expect("it is opened once"));
        PowerSampler::start(open, settings, false).expect("a thread")
    }

    fn is_lost(snapshot: &PowerSnapshot) -> bool {
        matches!(snapshot.state, MeterState::Lost { .. })
    }

    #[test]
    fn survives_a_meter_that_fails_and_returns() {
        let failing = Err(MeterError::unreadable("scripted", "unplugged"));
        let readings =
            (0..4).map(|index| Ok(Joules(f64::from(index)))).chain([failing.clone(), failing]);
        let readings = readings.chain((10..200).map(|index| Ok(Joules(f64::from(index)))));
        let sampler = sampler_of(ScriptedMeter::new(readings), QUICK);
        let running =
            wait_for(&sampler, "first figures", |snapshot| snapshot.state == MeterState::Running);
        assert!(running.latest.unwrap().0 > 0.0 && running.mean.unwrap().0 > 0.0);
        let lost = wait_for(&sampler, "loss", is_lost);
        assert_eq!((lost.latest, lost.mean), (None, None));
        let back = wait_for(&sampler, "return", |snapshot| snapshot.state == MeterState::Running);
        assert!(back.latest.unwrap().0 > 0.0);
    }

    #[test]
    fn a_meter_that_could_not_be_opened_is_tried_again() {
        let mut trials = 0;
        let open = move || {
            trials += 1;
            if trials < 4 {
                return crate::power::open("no such meter");
            }
            let readings = (0..200).map(|index| Ok(Joules(f64::from(index))));
            Ok(Box::new(ScriptedMeter::new(readings)) as Box<dyn PowerMeter>)
        };
        let sampler = PowerSampler::start(open, QUICK, false).unwrap();
        let mut seen = None;
        let mut refusals = 0;
        let running = loop {
            if let Some(snapshot) = sampler.snapshot_if_changed(&mut seen) {
                match snapshot.state {
                    MeterState::Unavailable { .. } => refusals += 1,
                    MeterState::Running => break snapshot,
                    _ => {}
                }
            }
            thread::sleep(Duration::from_millis(1));
        };
        assert!(running.latest.unwrap().0 > 0.0);
        assert!(refusals <= 1, "the same reason is said once, not {refusals} times");
    }

    #[test]
    fn a_meter_that_cannot_be_opened_is_unavailable_with_the_reason() {
        let sampler =
            PowerSampler::start(|| crate::power::open("no such meter"), QUICK, false).unwrap();
        let snapshot =
            wait_for(&sampler, "refusal", |snapshot| snapshot.state != MeterState::Starting);
        let MeterState::Unavailable { reason } = snapshot.state else { panic!("{snapshot:?}") };
        assert!(reason.contains("cpu-time"), "{reason}");
        assert_eq!(snapshot.latest, None);
    }

    /// Panics at the first reading, or never answers.
    struct BadMeter {
        hang: Option<Duration>,
    }

    impl PowerMeter for BadMeter {
        fn info(&self) -> MeterInfo {
            MeterInfo {
                name: "bad".to_owned(),
                provenance: Provenance::Modelled,
                description: String::new(),
            }
        }

        fn energy(&mut self) -> Result<Joules, MeterError> {
            match self.hang {
                Some(duration) => thread::sleep(duration),
                None => panic!("expected by the test: a meter that panics"),
            }
            Ok(Joules(0.0))
        }

        fn window_seconds(&self) -> f64 {
            1e-3
        }
    }

    #[test]
    fn a_meter_that_panics_is_lost() {
        let sampler = sampler_of(BadMeter { hang: None }, QUICK);
        wait_for(&sampler, "loss", is_lost);
    }

    #[test]
    fn a_meter_that_hangs_does_not_block_the_drop() {
        let sampler = sampler_of(BadMeter { hang: Some(Duration::from_secs(30)) }, QUICK);
        let start = Instant::now();
        drop(sampler);
        assert!(start.elapsed() < Duration::from_secs(15), "the meter hangs for 30 s");
    }

    #[test]
    fn the_longest_interval_overflows_nothing() {
        let settings = SamplerSettings { interval: Duration::MAX, ..QUICK };
        let sampler = sampler_of(ScriptedMeter::joules([1.0, 2.0]), settings);
        let snapshot = wait_for(&sampler, "meter", |snapshot| snapshot.info.is_some());
        assert_eq!(snapshot.latest, None, "one reading gives no power");
    }

    #[test]
    fn a_change_is_reported_once() {
        let sampler = sampler_of(ScriptedMeter::joules([1.0]).with_window_seconds(50.0), QUICK);
        wait_for(&sampler, "meter", |snapshot| snapshot.info.is_some());
        let mut seen = None;
        assert!(sampler.snapshot_if_changed(&mut seen).is_some());
        assert!(sampler.snapshot_if_changed(&mut seen).is_none(), "the next poll is 50 s away");
    }
}

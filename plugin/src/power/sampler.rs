//! Polls a meter on a thread of its own, since a reading may take milliseconds and a driver may not
//! answer at all.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::power::tracker::PowerTracker;
use crate::power::window::least_window;
use crate::power::{MeterError, MeterState, OpenMeterError, PowerMeter, PowerSnapshot};

/// Polling more often costs more power than it tells: at 1 kHz polling alone has been seen to slow
/// programs by tens of percent.
const LEAST_INTERVAL: Duration = Duration::from_millis(50);

/// A meter that has not answered for this long, or for this many intervals if that is longer,
/// hangs.
const HANGS_AFTER: Duration = Duration::from_secs(5);
const HANGS_AFTER_INTERVALS: u32 = 10;

/// How long the end of a sampler waits for its thread. A thread that hangs in a driver is left
/// behind rather than hanging the app too.
const FAREWELL: Duration = Duration::from_millis(500);

/// How often to read, and how much to smooth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerSettings {
    /// Time between readings. Raised to the meter's own window, and to 0.05 s. Higher values cost
    /// less power and give smoother figures; lower values follow changes sooner. Default 0.25 s.
    pub interval: Duration,
    /// Time constant of the mean. Higher values give a steadier mean; lower values follow changes
    /// sooner; 0 s is no smoothing. Default 2 s.
    pub smoothing: Duration,
}

impl Default for SamplerSettings {
    fn default() -> Self {
        Self { interval: Duration::from_millis(250), smoothing: Duration::from_secs(2) }
    }
}

/// What the thread tells.
#[derive(Debug)]
struct Published {
    snapshot: PowerSnapshot,
    interval: Duration,
    /// Rises with every poll.
    revision: u64,
    /// When the thread last told anything.
    at: Instant,
}

/// Polls a meter in the background and keeps the latest and the mean power. Stops when dropped.
///
/// A meter that fails is polled on: what comes back after an unplugged charger or a driver's
/// restart is found again.
#[derive(Debug)]
pub struct PowerSampler {
    published: Arc<Mutex<Published>>,
    /// Dropped to stop the thread.
    stop: Option<mpsc::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl PowerSampler {
    /// Starts to sample `meter`.
    ///
    /// # Errors
    /// `Unavailable` when the system gives no thread.
    pub fn start(
        meter: Box<dyn PowerMeter>,
        settings: SamplerSettings,
    ) -> Result<Self, MeterError> {
        Self::start_with(move || Ok(meter), settings)
    }

    /// Opens a meter on the sampling thread, where it may take its time, and starts to sample it.
    /// When there is none, the state becomes `Unavailable` with the reason.
    ///
    /// # Errors
    /// `Unavailable` when the system gives no thread.
    pub fn start_with(
        open: impl FnOnce() -> Result<Box<dyn PowerMeter>, OpenMeterError> + Send + 'static,
        settings: SamplerSettings,
    ) -> Result<Self, MeterError> {
        let published = Arc::new(Mutex::new(Published {
            snapshot: PowerSnapshot::default(),
            interval: settings.interval,
            revision: 0,
            at: Instant::now(),
        }));
        let (stop, stopped) = mpsc::channel();
        let told = Arc::clone(&published);
        let thread = thread::Builder::new()
            .name("frugal-gi-power".to_owned())
            .spawn(move || match open() {
                Ok(meter) => poll(meter, settings, &told, &stopped),
                Err(error) => {
                    let mut published = lock(&told);
                    published.snapshot.lose(MeterState::Unavailable { reason: error.to_string() });
                    published.revision += 1;
                }
            })
            .map_err(|error| {
                MeterError::unavailable("sampler", format!("no thread to sample on: {error}"))
            })?;
        Ok(Self { published, stop: Some(stop), thread: Some(thread) })
    }

    /// What is known now. Never waits for the meter.
    pub fn snapshot(&self) -> PowerSnapshot {
        let published = lock(&self.published);
        self.judged(&published)
    }

    /// What is known now, if that is news to whoever saw it `seen` last. Allocates nothing
    /// otherwise, so that it can be asked every frame.
    pub(crate) fn news(&self, seen: &mut Option<(u64, bool)>) -> Option<PowerSnapshot> {
        let published = lock(&self.published);
        let current = Some((published.revision, self.fault(&published).is_some()));
        if *seen == current {
            return None;
        }
        *seen = current;
        Some(self.judged(&published))
    }

    fn judged(&self, published: &Published) -> PowerSnapshot {
        let mut snapshot = published.snapshot.clone();
        if let Some(reason) = self.fault(published) {
            snapshot.lose(MeterState::Lost { reason });
        }
        snapshot
    }

    /// What is wrong with the thread itself, which the thread cannot tell.
    fn fault(&self, published: &Published) -> Option<String> {
        if matches!(published.snapshot.state, MeterState::Unavailable { .. }) {
            return None;
        }
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return Some("the meter panicked".to_owned());
        }
        let patience = HANGS_AFTER.max(published.interval * HANGS_AFTER_INTERVALS);
        // Says the limit and not the time so far, which would be another reason at every call.
        (published.at.elapsed() > patience)
            .then(|| format!("the meter has not answered for {:.0} s", patience.as_secs_f64()))
    }
}

impl Drop for PowerSampler {
    fn drop(&mut self) {
        drop(self.stop.take());
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() && start.elapsed() < FAREWELL {
            thread::sleep(Duration::from_millis(1));
        }
        if thread.is_finished() {
            // A panic in a meter was told by its own message and by the state; here is nothing left
            // to do about it.
            let _ = thread.join();
        }
    }
}

fn lock(published: &Mutex<Published>) -> MutexGuard<'_, Published> {
    // Each change leaves whole figures behind, so that a poisoned lock holds nothing half done.
    published.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reads until told to stop.
fn poll(
    mut meter: Box<dyn PowerMeter>,
    settings: SamplerSettings,
    published: &Mutex<Published>,
    stopped: &mpsc::Receiver<()>,
) {
    let window = least_window(meter.as_ref());
    let interval = settings.interval.max(window).max(LEAST_INTERVAL);
    let mut tracker = PowerTracker::new(meter.info(), meter.idle(), window, settings.smoothing);
    let origin = Instant::now();
    loop {
        let before = origin.elapsed();
        let answer = meter.energy();
        // The middle of the call: a driver may take milliseconds to answer.
        let at = before + (origin.elapsed() - before) / 2;
        tracker.push(answer, at);
        {
            let mut published = lock(published);
            published.snapshot.clone_from(tracker.snapshot());
            published.interval = interval;
            published.revision += 1;
            published.at = Instant::now();
        }
        match stopped.recv_timeout(interval) {
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Ok(()) | Err(mpsc::RecvTimeoutError::Disconnected) => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::{MeterInfo, Provenance, ScriptedMeter};
    use crate::units::Joules;

    const QUICK: SamplerSettings =
        SamplerSettings { interval: Duration::from_millis(50), smoothing: Duration::from_secs(1) };

    /// Waits for a state of affairs. Fails after 20 s, which a starved machine does not need
    /// either.
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

    fn is_lost(snapshot: &PowerSnapshot) -> bool {
        matches!(snapshot.state, MeterState::Lost { .. })
    }

    #[test]
    fn survives_a_meter_that_fails_and_returns() {
        let failing = Err(MeterError::unreadable("scripted", "unplugged"));
        let readings =
            (0..4).map(|index| Ok(Joules(f64::from(index)))).chain([failing.clone(), failing]);
        let readings = readings.chain((10..200).map(|index| Ok(Joules(f64::from(index)))));
        let sampler = PowerSampler::start(Box::new(ScriptedMeter::new(readings)), QUICK).unwrap();
        let running =
            wait_for(&sampler, "first figures", |snapshot| snapshot.state == MeterState::Running);
        assert!(running.latest.unwrap().0 > 0.0 && running.mean.unwrap().0 > 0.0);
        let lost = wait_for(&sampler, "loss", is_lost);
        assert_eq!((lost.latest, lost.mean), (None, None));
        let back = wait_for(&sampler, "return", |snapshot| snapshot.state == MeterState::Running);
        assert!(back.latest.unwrap().0 > 0.0);
    }

    #[test]
    fn a_meter_that_cannot_be_opened_is_unavailable_with_the_reason() {
        let sampler =
            PowerSampler::start_with(|| crate::power::open("no such meter"), QUICK).unwrap();
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
        let sampler = PowerSampler::start(Box::new(BadMeter { hang: None }), QUICK).unwrap();
        wait_for(&sampler, "loss", is_lost);
    }

    #[test]
    fn a_meter_that_hangs_does_not_hang_the_end() {
        let sampler =
            PowerSampler::start(Box::new(BadMeter { hang: Some(Duration::from_secs(30)) }), QUICK)
                .unwrap();
        let start = Instant::now();
        drop(sampler);
        assert!(start.elapsed() < Duration::from_secs(15), "the meter hangs for 30 s");
    }

    #[test]
    fn news_is_told_once() {
        let sampler = PowerSampler::start(
            Box::new(ScriptedMeter::joules([1.0]).with_window_seconds(50.0)),
            QUICK,
        )
        .unwrap();
        wait_for(&sampler, "meter", |snapshot| snapshot.info.is_some());
        let mut seen = None;
        assert!(sampler.news(&mut seen).is_some());
        assert!(sampler.news(&mut seen).is_none(), "the next poll is 50 s away");
    }
}

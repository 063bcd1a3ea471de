//! A thread that polls a source. Options:
//! 1. Read in the caller's thread: a power would be integrated over the two readings of a long
//!    window only, and a driver that hangs would hang the caller.
//! 2. A thread that reads on its own clock and publishes: its readings are as old as its interval.
//! 3. A thread that reads when asked, and on its own where nobody asks for long.
//!
//! We use option 3. A fault between two questions is kept for the next: a window over it has an
//! error, and not too little energy.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

// The standard one panics in a browser.
use bevy::platform::time::Instant;

use super::Source;
use crate::power::{MeterError, MeterInfo, PowerMeter};
use crate::units::Joules;

/// Time without an answer after which a file counts as hung.
const HANG_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between readings while the first update of a counter is awaited, and the most of it:
/// counters update every two seconds at the longest.
const SETTLE_INTERVAL: Duration = Duration::from_millis(5);
const SETTLE_TIMEOUT: Duration = Duration::from_secs(5);

/// Energy, `None` while the counter's first update is awaited.
type Answer = Result<Option<Joules>, MeterError>;

/// The meter of a source that a thread polls. The thread ends with the meter; one that hangs in a
/// file is left behind.
#[derive(Debug)]
pub(super) struct FileMeter {
    info: MeterInfo,
    window_seconds: f64,
    requests: mpsc::Sender<()>,
    answers: mpsc::Receiver<Answer>,
    /// An answer is late.
    is_waiting: bool,
}

impl FileMeter {
    /// Starts the thread, and waits for the source's first reading, at most some seconds.
    ///
    /// # Errors
    /// The source's own; [`MeterError::Unreadable`] for a file that hangs, [`MeterError::Broken`]
    /// for a counter that does not move.
    pub(super) fn start(source: Box<dyn Source>) -> Result<Self, MeterError> {
        let (info, window_seconds) = (source.info(), source.window_seconds());
        let (requests, requested) = mpsc::channel();
        let (answer, answers) = mpsc::channel();
        thread::Builder::new()
            .name(format!("frugal-gi-{}", info.name))
            .spawn(move || work(source, &requested, &answer))
            .map_err(|error| {
                MeterError::unavailable(&*info.name, format!("no thread to read it: {error}"))
            })?;
        let meter = Self { info, window_seconds, requests, answers, is_waiting: false };
        // The thread sends one answer unasked.
        match meter.answers.recv_timeout(SETTLE_TIMEOUT + HANG_TIMEOUT) {
            Ok(answer) => {
                meter.energy_of(answer)?;
                Ok(meter)
            }
            Err(_) => Err(meter.hung()),
        }
    }

    fn hung(&self) -> MeterError {
        let seconds = HANG_TIMEOUT.as_secs_f64();
        MeterError::unreadable(
            &*self.info.name,
            format!("its file has not answered for {seconds:.0} s"),
        )
    }

    fn energy_of(&self, answer: Answer) -> Result<Joules, MeterError> {
        answer?.ok_or_else(|| {
            MeterError::broken(&*self.info.name, "the counter's next update is awaited")
        })
    }
}

impl PowerMeter for FileMeter {
    fn info(&self) -> MeterInfo {
        self.info.clone()
    }

    fn energy(&mut self) -> Result<Joules, MeterError> {
        if self.is_waiting {
            // The late answer is too old to be used, but says that the file answers again.
            match self.answers.try_recv() {
                Ok(_) => self.is_waiting = false,
                Err(_) => return Err(self.hung()),
            }
        }
        if self.requests.send(()).is_err() {
            return Err(MeterError::broken(&*self.info.name, "its thread has ended"));
        }
        match self.answers.recv_timeout(HANG_TIMEOUT) {
            Ok(answer) => self.energy_of(answer),
            Err(mpsc::RecvTimeoutError::Timeout) => {
                self.is_waiting = true;
                Err(self.hung())
            }
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                Err(MeterError::broken(&*self.info.name, "its thread has ended"))
            }
        }
    }

    fn window_seconds(&self) -> f64 {
        self.window_seconds
    }
}

/// Answers requests until the meter is dropped.
fn work(
    mut source: Box<dyn Source>,
    requested: &mpsc::Receiver<()>,
    answers: &mpsc::Sender<Answer>,
) {
    let origin = Instant::now();
    let first = loop {
        match source.energy_at(origin.elapsed()) {
            Ok(None) if origin.elapsed() < SETTLE_TIMEOUT => thread::sleep(SETTLE_INTERVAL),
            Ok(None) => {
                let seconds = SETTLE_TIMEOUT.as_secs_f64();
                let reason = format!("the counter did not move in {seconds:.0} s");
                break Err(MeterError::broken(source.info().name, reason));
            }
            answer => break answer,
        }
    };
    if answers.send(first).is_err() {
        return;
    }
    let mut fault = None;
    loop {
        let is_asked = match requested.recv_timeout(source.poll()) {
            Ok(()) => true,
            Err(mpsc::RecvTimeoutError::Timeout) => false,
            Err(mpsc::RecvTimeoutError::Disconnected) => return,
        };
        let answer = source.energy_at(origin.elapsed());
        if !is_asked {
            fault = fault.or(answer.err());
        } else if answers.send(fault.take().map_or(answer, Err)).is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::power::Provenance;

    /// Plays a list of answers, the last one for ever, each after a delay.
    struct Scripted(Vec<(u64, Answer)>, Duration);

    impl Source for Scripted {
        fn info(&self) -> MeterInfo {
            MeterInfo {
                name: "scripted".to_owned(),
                provenance: Provenance::Measured,
                description: String::new(),
            }
        }

        fn window_seconds(&self) -> f64 {
            0.1
        }

        fn poll(&self) -> Duration {
            self.1
        }

        fn energy_at(&mut self, _: Duration) -> Answer {
            let (delay, answer) =
                if self.0.len() > 1 { self.0.remove(0) } else { self.0[0].clone() };
            thread::sleep(Duration::from_millis(delay));
            answer
        }
    }

    const NEVER: Duration = Duration::from_secs(3600);

    fn joules(value: f64) -> (u64, Answer) {
        (0, Ok(Some(Joules(value))))
    }

    #[test]
    fn it_waits_for_the_first_update_and_passes_answers_on() {
        let denied = MeterError::unreadable("scripted", "permission denied");
        let answers =
            vec![(0, Ok(None)), (0, Ok(None)), joules(0.0), joules(2.0), (0, Err(denied.clone()))];
        let mut meter = FileMeter::start(Box::new(Scripted(answers, NEVER))).expect("a meter");
        assert_eq!(meter.energy(), Ok(Joules(2.0)));
        assert_eq!((meter.energy(), meter.energy()), (Err(denied.clone()), Err(denied.clone())));
        let refused = FileMeter::start(Box::new(Scripted(vec![(0, Err(denied.clone()))], NEVER)));
        assert_eq!(refused.err(), Some(denied));
    }

    #[test]
    fn a_fault_between_two_questions_is_told_once() {
        let gone = MeterError::unreadable("scripted", "gone");
        let answers = vec![joules(0.0), (0, Err(gone.clone())), joules(3.0)];
        let poll = Duration::from_millis(1);
        let mut meter = FileMeter::start(Box::new(Scripted(answers, poll))).expect("a meter");
        thread::sleep(Duration::from_millis(200));
        assert_eq!(meter.energy(), Err(gone));
        assert_eq!(meter.energy(), Ok(Joules(3.0)));
    }

    #[test]
    fn a_file_that_hangs_is_lost_and_comes_back() {
        let answers = vec![joules(0.0), (3_000, Ok(Some(Joules(1.0)))), joules(2.0)];
        let mut meter = FileMeter::start(Box::new(Scripted(answers, NEVER))).expect("a meter");
        assert!(meter.energy().unwrap_err().to_string().contains("not answered"));
        let start = Instant::now();
        assert!(meter.energy().is_err() && start.elapsed() < Duration::from_millis(500));
        while meter.energy() != Ok(Joules(2.0)) {
            assert!(start.elapsed() < Duration::from_secs(20), "it answers again after 3 s");
            thread::sleep(Duration::from_millis(20));
        }
    }
}

//! Progress of long commands, and the interrupt key.

use std::io::IsTerminal as _;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static HANDLER: OnceLock<()> = OnceLock::new();

/// Whether the user has interrupted the command. A second interrupt ends it at once.
pub(super) fn interrupted() -> bool {
    HANDLER.get_or_init(|| {
        let handler = || {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
            eprintln!("\nfinishing the current step; interrupt again to stop at once");
        };
        // Without a handler the interrupt ends the process; the journal is kept all the same.
        let _ = ctrlc::set_handler(handler);
    });
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Shows where a command is: by a bar with the remaining time on a terminal, elsewhere by a line a
/// minute. The bar is removed when this is dropped.
pub(super) struct Progress {
    bar: ProgressBar,
    /// Where there is no terminal: since when, and minutes for which there was a line.
    started: Option<Instant>,
    told: AtomicU64,
}

impl Progress {
    /// Of `total` things called `what`.
    pub(super) fn new(total: u64, what: &'static str) -> Self {
        let bar = ProgressBar::new(total).with_message(what);
        let template = "{bar:30} {pos}/{len} {msg} [{elapsed} < {eta}]";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        let started = (!std::io::stderr().is_terminal()).then(Instant::now);
        Self { bar, started, told: AtomicU64::new(0) }
    }

    /// One more is done.
    pub(super) fn step(&self) {
        self.bar.inc(1);
        self.tell();
    }

    /// `done` of `total` are done; breaks once the user has interrupted the command.
    pub(super) fn at(&self, done: usize, total: usize, what: String) -> ControlFlow<()> {
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(what);
        self.tell();
        if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn tell(&self) {
        if let Some(line) = self.started.and_then(|started| self.line(started.elapsed())) {
            eprintln!("{line}");
        }
    }

    /// The line that is due after `elapsed`.
    fn line(&self, elapsed: Duration) -> Option<String> {
        let minutes = elapsed.as_secs() / 60;
        (self.told.fetch_max(minutes, Ordering::Relaxed) < minutes).then(|| {
            let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
            format!("{done} of {total} {}, after {minutes} min", self.bar.message())
        })
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_a_line_a_minute() {
        let progress = Progress::new(9, "rows");
        progress.step();
        let after = |seconds| progress.line(Duration::from_secs(seconds));
        assert_eq!((after(0), after(59)), (None, None));
        assert_eq!(after(61).as_deref(), Some("1 of 9 rows, after 1 min"));
        assert_eq!(after(119), None);
        let _ = progress.at(5, 10, "frames, maximum".to_owned());
        // A step of several minutes gives one line.
        assert_eq!(after(260).as_deref(), Some("5 of 10 frames, maximum, after 4 min"));
        assert_eq!(after(299), None);
    }
}

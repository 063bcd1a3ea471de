//! Progress bars, and the interrupt key.

use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};

use crate::pipeline::Progress;

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

/// A progress bar with the remaining time.
pub(super) fn bar(total: u64) -> ProgressBar {
    let bar = ProgressBar::new(total);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} [{elapsed} < {eta}]")
    {
        bar.set_style(style);
    }
    bar
}

/// Shows the progress of renderings on `bar`; breaks once the user has interrupted the command.
pub(super) fn of_renderings(bar: &ProgressBar) -> impl FnMut(&Progress<'_>) -> ControlFlow<()> {
    |progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("renderings, {}", progress.stage));
        if interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

//! Work that does not depend on the order, by several renderers.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

/// Each worker, in a thread of its own, takes the next job when it has done its last. What a job
/// tells goes to `done`, in this thread. Once that breaks, every worker ends with what it is at, which
/// still counts.
pub(crate) fn side_by_side<W: Send, J: Sync, R: Send>(
    workers: &mut [W],
    jobs: &[J],
    job: impl Fn(&mut W, &J, &dyn Fn(R) -> ControlFlow<()>) -> ControlFlow<()> + Sync,
    mut done: impl FnMut(R) -> ControlFlow<()>,
) {
    let (next, ends) = (AtomicUsize::new(0), AtomicBool::new(false));
    // Without a buffer, so that little is rendered after the end.
    let (sender, results) = mpsc::sync_channel(0);
    std::thread::scope(|scope| {
        for worker in workers {
            let (sender, next, ends, job) = (sender.clone(), &next, &ends, &job);
            scope.spawn(move || {
                let tell = |result| match sender.send(result) {
                    Ok(()) if !ends.load(Ordering::Relaxed) => ControlFlow::Continue(()),
                    _ => ControlFlow::Break(()),
                };
                while let Some(one) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if job(worker, one, &tell).is_break() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for result in results {
            if done(result).is_break() {
                ends.store(true, Ordering::Relaxed);
            }
        }
    });
}

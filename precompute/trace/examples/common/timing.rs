//! Processor time of work on one thread.

/// Seconds of work that are timed at least: the kernel counts in its ticks of some milliseconds.
const ENOUGH: f64 = 0.1;

/// What `work` returns, and the seconds that this thread has run for it: other processes do not
/// count. Short work is done often enough, and its mean counts. Work must not go to other threads:
/// inside of a pool of one thread, that of `rayon` stays here.
pub(crate) fn timed<T>(mut work: impl FnMut() -> T) -> (T, f64) {
    let (start, mut count) = (processor_time(), 0.0);
    loop {
        let result = work();
        count += 1.0;
        let seconds = processor_time() - start;
        if seconds >= ENOUGH {
            return (result, seconds / count);
        }
    }
}

fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split(' ').next().and_then(|text| text.parse::<f64>().ok());
    nanoseconds.expect("a number") * 1e-9
}

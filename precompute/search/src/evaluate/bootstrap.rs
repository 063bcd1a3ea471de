//! Statistical significance of differences between runs: a paired block bootstrap (Künsch 1989).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::FrameRecord;

/// Length of a block in seconds: neighbouring frames are correlated.
const BLOCK_SECONDS: f64 = 1.0;
/// Number of resamplings.
const RESAMPLINGS: usize = 2000;
/// Share of resamplings that must agree.
const CONFIDENCE: f64 = 0.95;

/// Whether `one` Pareto-dominates `other` in mean power and error over the same frames, in at least
/// 95 % of resampled paths.
pub(super) fn dominates(one: &[FrameRecord], other: &[FrameRecord], fps: f64) -> bool {
    let frames = one.len().min(other.len());
    let block = ((BLOCK_SECONDS * fps).round() as usize).clamp(1, frames.max(1));
    let count = frames.div_ceil(block);
    if count == 0 {
        return false;
    }
    let differences: Vec<[f64; 2]> = one
        .iter()
        .zip(other)
        .map(|(one, other)| [one.power.0 - other.power.0, one.error - other.error])
        .collect();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let mut agree = 0;
    for _ in 0..RESAMPLINGS {
        let (mut power, mut error) = (0.0, 0.0);
        for _ in 0..count {
            let start = random.random_range(0..frames);
            for offset in 0..block {
                let [p, e] = differences[(start + offset) % frames];
                power += p;
                error += e;
            }
        }
        agree += usize::from(power <= 0.0 && error <= 0.0 && (power < 0.0 || error < 0.0));
    }
    agree as f64 >= CONFIDENCE * RESAMPLINGS as f64
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::KnobLevels;
    use frugal_core::units::Watts;

    use super::*;

    fn series(power: impl Fn(usize) -> f64, error: f64) -> Vec<FrameRecord> {
        let frame = |index| FrameRecord {
            time: 0.0,
            settings: KnobLevels::default(),
            power: Watts(power(index)),
            error,
            predicted: None,
        };
        (0..120).map(frame).collect()
    }

    #[test]
    fn only_consistent_improvements_dominate() {
        let ours = series(|_| 5.0, 0.02);
        assert!(dominates(&series(|_| 4.9, 0.02), &ours, 15.0));
        assert!(dominates(&series(|_| 5.0, 0.019), &ours, 15.0));
        assert!(!dominates(&series(|_| 4.0, 0.021), &ours, 15.0), "a trade is no dominance");
        assert!(!dominates(&ours, &ours, 15.0));
        // Slightly lower in the mean, but varying by watts.
        let restless = series(|index| if index / 15 % 2 == 0 { 2.0 } else { 7.9 }, 0.02);
        assert!(!dominates(&restless, &ours, 15.0));
        assert!(!dominates(&[], &[], 15.0));
    }
}

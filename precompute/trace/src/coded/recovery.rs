//! How many frames undo random intensities.

use super::waveform::{CodedError, positive, share};

/// Someone who photographs a still scene many times, and puts together the rows that were fully lit
/// at one level of intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attack {
    duty: f64,
    levels: f64,
    /// Rows × independently modulated channels.
    rows: f64,
}

/// How levels of intensity are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draw {
    /// Every level in the same number of frames: Zhu et al. 2017, equation 8.
    Balanced,
    /// Each frame's level independently of the others'. Some levels then come late, and the attack
    /// takes more frames: 35 to 38 % more at a duty cycle of one half.
    Independent,
}

impl Attack {
    /// On a light of `duty` cycle in [0, 1] with `levels` levels of intensity, by a camera of `rows`
    /// rows; `channels` are modulated independently, 1 or 3.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when `duty` is, or another is 0.
    pub fn new(duty: f64, levels: u32, rows: u32, channels: u32) -> Result<Self, CodedError> {
        Ok(Self {
            duty: share("the duty cycle", duty)?,
            levels: positive("the number of levels", f64::from(levels))?,
            rows: positive("the number of rows", f64::from(rows))?
                * positive("the number of channels", f64::from(channels))?,
        })
    }

    /// Probability that `frames` frames, at least 0, show every row fully lit at one level.
    pub fn probability(&self, draw: Draw, frames: f64) -> f64 {
        // Logarithms, since the probability that a row is missing is tiny.
        let missing = (frames.max(0.0) * self.log_missed(draw)).exp();
        (self.rows * (-missing).ln_1p()).exp()
    }

    /// Frames for which [`probability`](Self::probability) is `wanted`, in [0, 1]; not whole.
    /// Infinite where no number is enough.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when `wanted` is.
    pub fn frames(&self, draw: Draw, wanted: f64) -> Result<f64, CodedError> {
        share("the probability", wanted)?;
        let missing = -(wanted.ln() / self.rows).exp_m1();
        let log_missed = self.log_missed(draw);
        Ok(if log_missed == 0.0 { f64::INFINITY } else { missing.ln() / log_missed })
    }

    /// Logarithm of the probability that one frame does not show one row at the level.
    fn log_missed(&self, draw: Draw) -> f64 {
        match draw {
            Draw::Balanced => (-self.duty).ln_1p() / self.levels,
            Draw::Independent => (-self.duty / self.levels).ln_1p(),
        }
    }
}

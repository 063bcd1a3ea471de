//! Square waves one after another.

use super::waveform::{CodedError, Modulation, Waveform, out_of, positive};

/// Least rate of a repeating pattern, hertz: eyes see slower ones flicker.
const FLICKER_FUSION: f64 = 80.0;

/// Square waves one after another, from the first again after the last. Each begins at its own
/// phase.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    blocks: Vec<Block>,
    /// Seconds until it repeats.
    period: f64,
    /// Light of one period.
    energy: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Block {
    /// Seconds and light before it, since the sequence's beginning.
    start: f64,
    before: f64,
    wave: Waveform,
}

impl Sequence {
    /// Waves with their durations, seconds, above 0.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when there is none, or a duration is out of range.
    pub fn new(waves: impl IntoIterator<Item = (f64, Waveform)>) -> Result<Self, CodedError> {
        let (mut period, mut energy, mut blocks) = (0.0, 0.0, Vec::new());
        for (duration, wave) in waves {
            positive("the duration of a wave", duration)?;
            blocks.push(Block { start: period, before: energy, wave });
            energy += wave.light(0.0, duration);
            period += duration;
        }
        positive("the duration of a sequence", period)?;
        Ok(Self { blocks, period, energy })
    }

    /// Frequencies in turn, so that no exposure is a whole number of periods of all of them:
    /// `switch_rate` + n · `step` for n from 0 to `count` − 1, each for 1 ÷ `switch_rate` seconds; all in
    /// hertz. `duty` and `peak` as of [`Waveform::new`]. Zhu et al. take (2, 200), (3, 300), … (6, 600)
    /// for `count` and `switch_rate`, and a `step` of 50, which itself hardly matters.
    ///
    /// Only an exposure of the whole pattern (10 ms for the published ones) undoes it: in bright light
    /// it overexposes.
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when `count` is 0, `step` is negative or equals `switch_rate`, or the
    /// pattern would be seen to flicker; and as [`Waveform::new`].
    pub fn scrambled(
        count: u32,
        switch_rate: f64,
        step: f64,
        duty: f64,
        peak: f64,
    ) -> Result<Self, CodedError> {
        positive("the number of frequencies", f64::from(count))?;
        positive("the rate of switches", switch_rate)?;
        if switch_rate <= f64::from(count) * FLICKER_FUSION {
            return out_of(
                "the rate of switches",
                switch_rate,
                "above 80 Hz times the frequencies",
            );
        }
        if !(step.is_finite() && step >= 0.0) || step == switch_rate {
            return out_of("the step", step, "at least 0 and not the rate of switches");
        }
        let wave = |n: u32| Waveform::new(switch_rate + f64::from(n) * step, duty, 0.0, peak);
        let waves: Vec<Waveform> = (0..count).map(wave).collect::<Result<_, _>>()?;
        Self::new(waves.into_iter().map(|wave| (1.0 / switch_rate, wave)))
    }

    /// Light from the beginning until `time`, in [0, period].
    fn until(&self, time: f64) -> f64 {
        let after = self.blocks.partition_point(|block| block.start <= time);
        let block = &self.blocks[after.saturating_sub(1)];
        block.before + block.wave.light(0.0, time - block.start)
    }
}

impl Modulation for Sequence {
    fn light(&self, start: f64, duration: f64) -> f64 {
        let from = start.rem_euclid(self.period);
        let to = from + duration.max(0.0);
        let repeats = (to / self.period).floor();
        let rest = (to - repeats * self.period).clamp(0.0, self.period);
        repeats * self.energy + self.until(rest) - self.until(from)
    }

    fn mean(&self) -> f64 {
        self.energy / self.period
    }
}

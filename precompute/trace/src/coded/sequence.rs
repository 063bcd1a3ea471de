//! Square waves one after another.

use super::waveform::{CodedError, Modulation, Waveform, out_of, positive};
use crate::sampler::Sampler;

/// Least rate of a repeating pattern, hertz: eyes see slower ones flicker.
const FLICKER_FUSION: f64 = 80.0;
/// Frames per second of the cameras to protect from, at most.
const FRAME_RATE: f64 = 30.0;

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

    /// `periods` periods of a square wave whose peak is each time one of `levels` equal steps up to
    /// `peak`, at random.
    ///
    /// # Errors
    /// As [`Waveform::new`], and when `periods` or `levels` is 0.
    pub fn random_intensities(
        frequency: f64,
        duty: f64,
        peak: f64,
        levels: u32,
        periods: u32,
        seed: u64,
    ) -> Result<Self, CodedError> {
        positive("the number of levels", f64::from(levels))?;
        let wave = |i: u32| {
            let number = Sampler::new(seed, u64::from(i), 0).number();
            let level = (number * f64::from(levels)).floor() + 1.0;
            Waveform::new(frequency, duty, 0.0, peak * level / f64::from(levels))
        };
        let waves: Vec<Waveform> = (0..periods).map(wave).collect::<Result<_, _>>()?;
        Self::new(waves.into_iter().map(|wave| (1.0 / frequency, wave)))
    }

    /// Seconds until it repeats.
    pub fn period(&self) -> f64 {
        self.period
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

/// Frequencies in turn, so that no exposure is a whole number of periods of all of them. Only an
/// exposure of the whole pattern (10 ms for the published ones) undoes it: in bright light it
/// overexposes.
#[derive(Clone, Debug, PartialEq)]
pub struct Scramble {
    frequencies: Vec<f64>,
    switch_rate: f64,
}

impl Scramble {
    /// The frequencies `switch_rate` + n · `step` for n from 0 to `count` − 1, each for
    /// 1 ÷ `switch_rate` seconds; all in hertz. Zhu et al. take (2, 200), (3, 300), … (6, 600) for
    /// `count` and `switch_rate`, and [`best_step`].
    ///
    /// # Errors
    /// [`CodedError::OutOfRange`] when `count` is 0, `step` is negative or equals `switch_rate`,
    /// the switches are too slow to fall into every frame, or the pattern would be seen to flicker.
    pub fn new(count: u32, switch_rate: f64, step: f64) -> Result<Self, CodedError> {
        positive("the number of frequencies", f64::from(count))?;
        positive("the rate of switches", switch_rate)?;
        if switch_rate <= f64::from(count) * FRAME_RATE {
            return out_of(
                "the rate of switches",
                switch_rate,
                "above 30 Hz times the frequencies",
            );
        }
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
        let frequencies = (0..count).map(|n| switch_rate + f64::from(n) * step).collect();
        Ok(Self { frequencies, switch_rate })
    }

    /// Hertz.
    pub fn frequencies(&self) -> &[f64] {
        &self.frequencies
    }

    /// Repetitions of the whole pattern per second: the lowest frequency of its light.
    pub fn pattern_rate(&self) -> f64 {
        self.switch_rate / self.frequencies.len() as f64
    }

    /// A light with this pattern; arguments as of [`Waveform::new`].
    ///
    /// # Errors
    /// As [`Waveform::new`].
    pub fn sequence(&self, duty: f64, peak: f64) -> Result<Sequence, CodedError> {
        let waves = self.frequencies.iter().map(|f| Waveform::new(*f, duty, 0.0, peak));
        let waves: Vec<Waveform> = waves.collect::<Result<_, _>>()?;
        Sequence::new(waves.into_iter().map(|wave| (1.0 / self.switch_rate, wave)))
    }
}

/// The step between frequencies, hertz, that Zhu et al. 2017 found best: 1 ÷ (2 t), where t,
/// seconds and above 0, is the longest exposure that does not overexpose; 50 Hz for 10 ms.
///
/// The step itself hardly matters. An exposure of 10 ms, the period of all the published patterns,
/// leaves no deviation.
pub fn best_step(longest_exposure: f64) -> f64 {
    0.5 / longest_exposure
}

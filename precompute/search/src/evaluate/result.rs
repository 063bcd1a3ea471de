//! Results of an evaluation, as `--json` writes them.

use frugal_core::knobs::KnobSpace;
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;
use serde::{Deserialize, Serialize, Serializer};

use super::{FrameRecord, ResolvedBudget};

/// Relative change of the best settings' mean power from which drift is reported.
const NOTABLE_DRIFT: f64 = 0.05;
/// Relative difference of a rendered run's mean power from the simulated one's that is reported. Transitions
/// alone make some per cent.
const NOTABLE_DIFFERENCE: f64 = 0.1;
/// What a mean, or one of a window of the horizon, may exceed a power budget by.
const ALLOWED: f64 = 1.02;
/// Mean error between two runs at the same settings from which noise is reported. Half the smallest
/// error step that subdivision considers.
const NOTABLE_NOISE: f64 = 0.001;

/// How figures of docs/data were made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// The machine.
    pub machine: String,
    /// The graphics driver.
    pub driver: String,
    /// The day, as year-month-day.
    pub date: String,
    /// The command lines.
    pub command: Vec<String>,
}

/// Power and error of every run along one path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationResult {
    /// The scene, as named on the command line.
    pub scene: String,
    /// The path.
    pub path: String,
    /// Frames of the path. Runs walk it there and back until they last two horizons.
    pub frames: usize,
    /// Target frame rate, to which all watts refer.
    #[serde(serialize_with = "whole_where_whole")]
    pub fps: f64,
    /// Width and height of the images, pixels.
    pub size: [u32; 2],
    /// The power meter.
    pub meter: MeterInfo,
    /// The limits in absolute terms.
    pub budget: ResolvedBudget,
    /// The requested limits, in words.
    pub asked: String,
    /// Every run, simulated from a record of the path: the controller's first, then the baselines.
    pub runs: Vec<RunResult>,
    /// Drift of the machine during the real play; 0 without one.
    pub drift: Drift,
    /// Warnings that qualify the figures.
    pub warnings: Vec<String>,
    /// A rendered frugal run, for comparison.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spot_check: Option<SpotCheck>,
}

/// A rendered frugal run beside its simulation from the record.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpotCheck {
    /// Mean power of the rendered run.
    pub mean_power_w: Watts,
    /// Mean error of the rendered run.
    pub mean_error: f64,
    /// Mean power of the simulated run.
    pub recorded_mean_power_w: Watts,
    /// Mean error of the simulated run.
    pub recorded_mean_error: f64,
}

/// One run along the path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// `frugal`, `maximum`, `max-mid`, `mid-min`, `minimum`, `resolution-only` or the name of
    /// another baseline.
    pub name: String,
    /// Mean over the frames.
    pub mean_power_w: Watts,
    /// Mean over the frames of 1 − SSIM.
    pub mean_error: f64,
    /// The worst frame's error.
    pub max_error: f64,
    /// Frames whose power or error exceeds a limit.
    pub frames_over_budget: usize,
    /// Frames whose settings differ from the previous frame's.
    pub switches: usize,
    /// The settings in words, if constant.
    pub settings: Option<String>,
    /// Whether mean power, by 2 %, and mean error keep the budget.
    pub met: bool,
    /// Share of windows of the horizon whose mean power exceeds the power budget by more than 2 %;
    /// `None` without a power budget.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub windows_over: Option<f64>,
    /// A remark on this run.
    pub note: Option<String>,
    /// Every frame. Not in the JSON: `frames.csv` holds it.
    #[serde(skip)]
    pub series: Vec<FrameRecord>,
}

/// The best settings played for real before and after the frugal run: any change is drift of the
/// machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Drift {
    /// Mean power of the first maximum run.
    pub first_mean_power_w: Watts,
    /// Mean power of the last.
    pub last_mean_power_w: Watts,
    /// (last − first) ÷ first; 0 where the first is 0 W.
    pub relative: f64,
    /// Mean error of the last run's images against the first's: the noise in any run's error. 0
    /// where rendering is deterministic.
    pub repeat_mean_error: f64,
    /// The largest such error of a frame.
    pub repeat_max_error: f64,
}

impl Drift {
    /// From the `first` run at the best settings to the `last`.
    pub fn between(first: &[FrameRecord], last: &[FrameRecord]) -> Self {
        let (before, after) = (mean_power(first), mean_power(last));
        Self {
            first_mean_power_w: before,
            last_mean_power_w: after,
            relative: if before.0 > 0.0 { after.0 / before.0 - 1.0 } else { 0.0 },
            repeat_mean_error: mean_error(last),
            repeat_max_error: max_error(last),
        }
    }
}

impl EvaluationResult {
    /// Adds a rendered frugal run along the path, the same simulated, and the drift around it.
    pub fn add_check(&mut self, real: &[FrameRecord], simulated: &[FrameRecord], drift: Drift) {
        self.spot_check = Some(SpotCheck {
            mean_power_w: mean_power(real),
            mean_error: mean_error(real),
            recorded_mean_power_w: mean_power(simulated),
            recorded_mean_error: mean_error(simulated),
        });
        self.drift = drift;
        let [rendered, recorded] = [real, simulated].map(|run| mean_power(run).0);
        let off = rendered / recorded - 1.0;
        if off.abs() > NOTABLE_DIFFERENCE {
            let (percent, more) = (100.0 * off.abs(), if off > 0.0 { "more" } else { "less" });
            self.warnings.push(format!("rendered, the run took {percent:.0} % {more} power than the record says: its watts do not hold in play; stop other programs, or use `--meter work`"));
        }
        if drift.relative.abs() > NOTABLE_DRIFT {
            let percent = 100.0 * drift.relative;
            self.warnings.push(format!("the same settings took {percent:+.1}% power at the end: smaller differences between runs are the machine's drift"));
        }
        if drift.repeat_mean_error > NOTABLE_NOISE {
            let error = drift.repeat_mean_error;
            self.warnings.push(format!("the same settings rendered twice differ by an error of {error:.4}: smaller errors are noise"));
        }
    }
}

impl RunResult {
    /// Summarises the frames of a run; `series` is not empty.
    pub(super) fn new(
        name: &str,
        series: Vec<FrameRecord>,
        budget: &ResolvedBudget,
        space: &KnobSpace,
        fps: f64,
    ) -> Self {
        let (mean_power_w, mean_error) = (mean_power(&series), mean_error(&series));
        let switches =
            series.windows(2).filter(|pair| pair[0].settings != pair[1].settings).count();
        let constant = series.first().filter(|_| switches == 0);
        let is_over = |frame: &&FrameRecord| !budget.keeps(frame.power, frame.error);
        let window = ((budget.horizon_s * fps).round() as usize).clamp(1, series.len().max(1));
        Self {
            name: name.to_owned(),
            mean_power_w,
            mean_error,
            max_error: max_error(&series),
            frames_over_budget: series.iter().filter(is_over).count(),
            switches,
            settings: constant.map(|frame| space.describe(frame.settings)),
            met: meets(budget, mean_power_w, mean_error),
            windows_over: budget.power_w.map(|limit| {
                let mut sum: f64 = series[..window].iter().map(|frame| frame.power.0).sum();
                let most = ALLOWED * limit.0 * window as f64;
                let mut over = usize::from(sum > most);
                for next in window..series.len() {
                    sum += series[next].power.0 - series[next - window].power.0;
                    over += usize::from(sum > most);
                }
                over as f64 / (series.len() - window + 1) as f64
            }),
            note: None,
            series,
        }
    }
}

/// Whether means of power, by 2 %, and of error keep a budget.
pub(super) fn meets(budget: &ResolvedBudget, power: Watts, error: f64) -> bool {
    budget.keeps(power * (1.0 / ALLOWED), error)
}

pub(super) fn mean_power(series: &[FrameRecord]) -> Watts {
    Watts(mean(series.iter().map(|frame| frame.power.0)))
}

pub(super) fn mean_error(series: &[FrameRecord]) -> f64 {
    mean(series.iter().map(|frame| frame.error))
}

fn max_error(series: &[FrameRecord]) -> f64 {
    series.iter().map(|frame| frame.error).fold(0.0, f64::max)
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// Whole frame rates are written as integers: `30`.
fn whole_where_whole<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.fract() == 0.0 && value.abs() < 1e9 {
        serializer.serialize_i64(*value as i64)
    } else {
        serializer.serialize_f64(*value)
    }
}

#[cfg(test)]
mod tests {
    use frugal_core::knobs::KnobLevels;

    use super::*;

    fn frame(settings: u128, power: f64, error: f64) -> FrameRecord {
        let settings = KnobLevels::from_bits(settings);
        FrameRecord { time: 0.0, settings, power: Watts(power), error, predicted: None }
    }

    #[test]
    fn a_run_is_summed_up() {
        let series =
            vec![frame(0, 1.0, 0.0), frame(1, 3.0, 0.2), frame(1, 3.0, 0.0), frame(0, 5.0, 0.0)];
        let budget =
            ResolvedBudget { power_w: Some(Watts(3.0)), error: Some(0.1), ..Default::default() };
        let run = RunResult::new("frugal", series, &budget, &KnobSpace::default(), 30.0);
        assert_eq!(run.mean_power_w, Watts(3.0));
        assert_eq!(
            (run.frames_over_budget, run.switches),
            (2, 2),
            "one frame exceeds by error, one by power"
        );
        assert_eq!((run.mean_error, run.max_error, run.met), (0.05, 0.2, true));
        assert_eq!(run.settings, None, "they changed");
    }

    #[test]
    fn without_a_budget_nothing_is_over_it() {
        let run = RunResult::new(
            "minimum",
            vec![frame(0, 1.0, 2.0)],
            &ResolvedBudget::default(),
            &KnobSpace::default(),
            30.0,
        );
        assert_eq!((run.frames_over_budget, run.windows_over, run.met), (0, None, true));
        assert_eq!(run.settings.as_deref(), Some(""));
    }

    #[test]
    fn drift_of_a_machine_that_uses_nothing_is_nothing() {
        assert_eq!(Drift::between(&[frame(0, 0.0, 0.0)], &[frame(0, 0.0, 0.0)]).relative, 0.0);
        assert!(
            (Drift::between(&[frame(0, 2.0, 0.0)], &[frame(0, 2.1, 0.0)]).relative - 0.05).abs()
                < 1e-12
        );
    }
}

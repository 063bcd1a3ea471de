//! Power and error of many settings at every frame of a path, from which policies are simulated
//! without rendering.
//!
//! Two things differ from rendered runs: a frame's temporal history has the same settings
//! throughout; and unrecorded settings, which the temporal filter passes through, are interpolated
//! between the recorded ones before and after. The spot check of an
//! [`EvaluationResult`](super::EvaluationResult) measures the difference with a rendered run.

use crate::journal::read_cost;
use crate::table::CostTable;
use frugal_core::frontier::CostPoint;
use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::{Choice, FrameRecord, PathPlan, Policy};

/// Costs of settings at every frame of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathRecord {
    /// The path.
    pub path: PathPlan,
    /// The knobs that settings refer to.
    pub space: KnobSpace,
    /// A row for each frame.
    pub table: CostTable,
}

impl PathRecord {
    /// A record of `path` from a journal's lines; lines of other kinds, and incomplete runs, are
    /// left out.
    pub fn restore(path: &PathPlan, space: &KnobSpace, records: &[String]) -> Self {
        let mut all = CostTable::new(path.poses().len());
        for (settings, frame, cost) in records.iter().filter_map(|record| read_line(record)) {
            all.set(frame, settings, cost);
        }
        let mut table = CostTable::new(all.rows());
        for (column, settings) in all.settings().iter().enumerate() {
            if all.is_complete(column) {
                all.known(column).for_each(|(frame, cost)| table.set(frame, *settings, cost));
            }
        }
        Self { path: path.clone(), space: space.clone(), table }
    }

    /// Simulates a policy's run from this record.
    pub fn simulate(&self, policy: &mut dyn Policy) -> Vec<FrameRecord> {
        self.walk(policy, 0..self.path.poses().len())
    }

    /// Simulates a policy's run along the path and back, again and again, until it has lasted `seconds`:
    /// an even number of ways, at least two.
    pub fn simulate_for(&self, policy: &mut dyn Policy, seconds: f64) -> Vec<FrameRecord> {
        let frames = self.path.poses().len();
        let rounds = (seconds * self.path.fps() / (2.0 * frames as f64)).ceil();
        // Not `clamp`, which passes NaN through.
        let rounds = if rounds.is_nan() { 1.0 } else { rounds.clamp(1.0, MAX_ROUNDS) };
        let round = || (0..frames).chain((0..frames).rev());
        self.walk(policy, (0..rounds as usize).flat_map(|_| round()))
    }

    fn walk(
        &self,
        policy: &mut dyn Policy,
        frames: impl Iterator<Item = usize>,
    ) -> Vec<FrameRecord> {
        let dt = self.path.fps().recip();
        let mut last = None;
        let records = frames.enumerate().map(|(step, frame)| {
            let pose = &self.path.poses()[frame];
            let Choice { settings, target, predicted } = policy.decide(frame, dt, pose);
            let cost = self.cost(frame, settings, target, &mut last);
            policy.observe(cost);
            FrameRecord {
                time: step as f64 * dt,
                settings,
                power: cost.power,
                error: cost.error,
                predicted,
            }
        });
        records.collect()
    }

    /// Cost of `settings` at a frame. `last`: the last recorded settings of the run. Unrecorded
    /// settings between them and `target` are interpolated by the share of level steps completed,
    /// in the logarithms of power and error.
    pub fn cost(
        &self,
        frame: usize,
        settings: KnobLevels,
        target: KnobLevels,
        last: &mut Option<KnobLevels>,
    ) -> CostPoint {
        let canonical = self.space.canonical(settings);
        if let Some(cost) = self.table.get(frame, canonical) {
            *last = Some(canonical);
            return cost;
        }
        let target = self.space.canonical(target);
        let to = self.table.get(frame, target).map(|cost| (cost, self.steps(settings, target)));
        let from =
            last.and_then(|last| Some((self.table.get(frame, last)?, self.steps(last, settings))));
        match (from, to) {
            (Some((from, done)), Some((to, left))) => {
                let share = done as f64 / (done + left).max(1) as f64;
                let between = |a: f64, b: f64| {
                    ((1.0 - share) * (a + LEAST).ln() + share * (b + LEAST).ln()).exp() - LEAST
                };
                CostPoint::new(
                    between(from.power.0, to.power.0),
                    between(from.error, to.error).max(0.0),
                )
            }
            (Some((cost, _)), None) | (None, Some((cost, _))) => cost,
            (None, None) => CostPoint::new(f64::NAN, f64::NAN),
        }
    }

    fn steps(&self, a: KnobLevels, b: KnobLevels) -> usize {
        (0..self.space.len()).map(|knob| a.level(knob).abs_diff(b.level(knob))).sum()
    }
}

/// Most ways there and back.
const MAX_ROUNDS: f64 = 400.0;
/// Keeps the logarithm of an error of 0 finite.
const LEAST: f64 = 1e-4;

fn read_line(record: &str) -> Option<(KnobLevels, usize, CostPoint)> {
    let (question, cost) = read_cost(record)?;
    let (settings, frame) = question.strip_prefix("frame ")?.split_once(' ')?;
    let settings = KnobLevels::from_bits(u128::from_str_radix(settings, 16).ok()?);
    Some((settings, usize::from_str_radix(frame, 16).ok()?, cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::{Fixed, Pose};
    use crate::testing::formula::{path, record_of, space};

    fn recorded(settings: &[KnobLevels]) -> PathRecord {
        record_of(path(), space(), settings)
    }

    #[test]
    fn a_path_is_walked_there_and_back_until_the_time_is_over() {
        let (low, high) = (space().canonical(space().lowest()), space().highest());
        let record = recorded(&[low, high]);
        let frames = path().poses().len();
        let round: Vec<usize> = (0..frames).chain((0..frames).rev()).collect();
        let seconds = frames as f64 / path().fps();
        for (asked, rounds) in [(0.0, 1), (2.0 * seconds, 1), (2.1 * seconds, 2), (f64::NAN, 1)] {
            let mut visited = Vec::new();
            let mut policy = |frame: usize, _: f64, _: &Pose| {
                visited.push(frame);
                Choice::from(if visited.len() <= frames { low } else { high })
            };
            let walked = record.simulate_for(&mut policy, asked);
            assert_eq!(visited, round.repeat(rounds), "{asked} s");
            assert_eq!(walked[..frames], record.simulate(&mut Fixed(low)));
            let mut back = record.simulate(&mut Fixed(high));
            back.reverse();
            let costs = |frames: &[FrameRecord]| -> Vec<_> {
                frames.iter().map(|frame| (frame.settings, frame.power, frame.error)).collect()
            };
            assert_eq!(costs(&walked[frames..2 * frames]), costs(&back));
            assert!(walked.windows(2).all(|two| two[0].time < two[1].time));
        }
    }

    #[test]
    fn settings_in_a_transition_are_interpolated() {
        let (low, high) = (space().canonical(space().lowest()), space().highest());
        let record = recorded(&[low]);
        let half = space().preset(0.5);
        let mut transition = |frame: usize, _: f64, _: &Pose| {
            let settings = [high, half, low][frame.min(2)];
            Choice { settings, target: low, predicted: None }
        };
        let series = record.simulate(&mut transition);
        assert!(series[1].power < series[0].power && series[1].power > series[2].power);
        assert!(series[1].error > series[0].error && series[1].error < series[2].error);
        let unknown = record.simulate(&mut Fixed(half));
        assert!(unknown[0].power.0.is_nan(), "unknown costs are not invented");
    }
}

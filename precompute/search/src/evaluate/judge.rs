//! Comparison of all policies under one budget, simulated from a record.

use frugal_core::control::{ControlSettings, SettingsFilter};
use frugal_core::frontier::{
    CameraView, FrontierMap, FrontierStore, SampleCamera, SampleRef, ViewDirection,
};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::power::MeterInfo;
use frugal_core::units::Watts;

use super::baselines::{Oracle, Reactive, best_of, ladder, mixed_constants, oracle};
use super::result::{mean_error, mean_power, meets};
use super::{
    BudgetRequest, Choice, Controller, EvaluationResult, Fixed, FrameRecord, PathRecord, Policy,
    Pose, PowerBudget, ResolvedBudget, RunResult,
};

/// Extent of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Baselines {
    /// Constants, oracles, the reactive ladder, presets, resolution.
    All,
    /// Presets, resolution, and the constant by training cameras.
    Quick,
    /// None: the frugal run alone.
    None,
}

/// Name of the run of the best constant settings by the training cameras.
pub(super) const TRAINED: &str = "trained-constant";
/// Name of the knob that `resolution-only` sets.
const RESOLUTION_KNOB: &str = "resolution_scale";

/// How many horizons a run lasts, at least.
const HORIZONS: f64 = 2.0;
/// Play that counts, and before that, seconds.
const PLAYED_SECONDS: f64 = 1200.0;
/// What a measurement costs, in frames of the best settings (`make bench BENCH=error_meter`).
const METER_FRAMES: f64 = 5.0;
/// Frame rate at which the meter's cost is spread, hertz. Recorded paths have fewer frames a second.
const METER_FPS: f64 = 60.0;

/// Settings to record for a comparison: the ends and those of the map, the presets and those with
/// only the resolution lowered, `default` and those with only the share of GI pixels lowered.
pub fn settings_to_record(
    map: &FrontierMap,
    baselines: Baselines,
    default: KnobLevels,
) -> Vec<KnobLevels> {
    let space = &map.knobs;
    let mut all = vec![space.highest(), space.lowest()];
    if baselines != Baselines::None {
        all.extend([2.0 / 3.0, 1.0 / 3.0].map(|share| space.preset(share)));
        all.extend(levels_of(space, RESOLUTION_KNOB));
    }
    if baselines == Baselines::All {
        all.push(default);
        all.extend(levels_of(space, "gi_pixel_fraction"));
    }
    all.extend(map.settings());
    space.canonical_once(all)
}

/// All knobs at their best but the one called `name`, at each of its levels.
fn levels_of(space: &KnobSpace, name: &str) -> Vec<KnobLevels> {
    let Some(knob) = space.index_of(name) else { return Vec::new() };
    (0..space.knobs()[knob].levels.len())
        .map(|level| space.canonical(space.highest().with_level(knob, level)))
        .collect()
}

/// What is compared, and under which conditions.
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// The scene's name, for the result.
    pub scene: &'a str,
    /// Costs along the path.
    pub record: &'a PathRecord,
    /// The map.
    pub map: &'a FrontierMap,
    /// Vertical field of view in radians, and width ÷ height.
    pub lens: (f32, f32),
    /// Width and height of the images, pixels.
    pub size: [u32; 2],
    /// The meter.
    pub meter: &'a MeterInfo,
    /// Time constants of the temporal filter, for the frugal run and the filtered oracle.
    pub control: ControlSettings,
    /// What to compare with.
    pub baselines: Baselines,
    /// The settings of an app that sets nothing.
    pub default: KnobLevels,
}

impl<'a> Trial<'a> {
    /// The controller under a budget.
    pub fn controller(&self, budget: &ResolvedBudget) -> Controller<'a> {
        Controller::new(self.map, budget, self.lens, self.control)
    }

    /// Simulates a policy's run along the path, there and back, for two horizons of `budget`.
    fn play(&self, policy: &mut dyn Policy, budget: &ResolvedBudget) -> Vec<FrameRecord> {
        self.record.simulate_for(policy, HORIZONS * budget.horizon_s)
    }

    /// Simulates all runs under a budget.
    pub fn judge(&self, request: &BudgetRequest) -> EvaluationResult {
        let (record, path) = (self.record, &self.record.path);
        let mean_power = |settings: KnobLevels| {
            let column = record.table.column(record.space.canonical(settings));
            let mean = column.and_then(|column| record.table.mean(column, 0..record.table.rows()));
            mean.map_or(Watts(f64::NAN), |cost| cost.power)
        };
        let [lowest, highest] = [record.space.lowest(), record.space.highest()].map(mean_power);
        let budget = request.resolve(lowest, highest);
        let mut warnings = vec![
            "runs are simulated from a record of the path: settings in transitions of the filter are interpolated".to_owned(),
        ];
        if highest <= lowest {
            let meaning = if matches!(request.power, Some(PowerBudget::Share(_))) {
                ", so a percentage between them is undefined"
            } else {
                ""
            };
            warnings.push(format!("the highest settings took no more power ({:.3} W) than the lowest ({:.3} W){meaning}", highest.0, lowest.0));
        }
        let frugal = self.play(&mut self.controller(&budget), &budget);
        let mut runs = vec![("frugal", frugal, None)];
        if self.baselines != Baselines::None {
            if record.space.index_of(RESOLUTION_KNOB).is_none() {
                warnings.push(format!(
                    "the run resolution-only is missing: this scene's knobs lack `{RESOLUTION_KNOB}`"
                ));
            }
            runs.extend(self.baselines(&budget, highest));
        }
        let result = |(name, series, note): Run| RunResult {
            note: note.map(str::to_owned),
            ..RunResult::new(name, series, &budget, &record.space, path.fps())
        };
        let runs: Vec<RunResult> = runs.into_iter().map(result).collect();
        EvaluationResult {
            scene: self.scene.to_owned(),
            path: path.name().to_owned(),
            frames: path.poses().len(),
            fps: path.fps(),
            size: self.size,
            meter: self.meter.clone(),
            budget,
            asked: request.to_string(),
            runs,
            drift: Default::default(),
            warnings,
            spot_check: None,
        }
    }

    /// `best`: power of the best settings.
    fn baselines(&self, budget: &ResolvedBudget, best: Watts) -> Vec<Run> {
        let (record, space) = (self.record, &self.record.space);
        let fixed = |settings: KnobLevels| self.play(&mut Fixed(settings), budget);
        let is_all = self.baselines == Baselines::All;
        let mut runs = vec![
            ("maximum", fixed(space.highest()), None),
            ("max-mid", fixed(space.preset(2.0 / 3.0)), None),
            ("mid-min", fixed(space.preset(1.0 / 3.0)), None),
            ("minimum", fixed(space.lowest()), None),
        ];
        if is_all && budget.error.is_some() {
            let mut controller = self.controller(budget);
            controller.has_error_meter = true;
            let series = measured(record, controller, best);
            let remark = "error meter on, its power included; mean of minutes 20 to 40";
            runs.push(("frugal-measured", series, Some(remark)));
        }
        let scaled = levels_of(space, RESOLUTION_KNOB);
        let scaled = record.table.means().filter(|(settings, _)| scaled.contains(settings));
        if let Some((settings, _)) = best_of(scaled, budget) {
            let series = fixed(settings);
            let is_met = meets(budget, mean_power(&series), mean_error(&series));
            let closest = "no resolution meets the budget: this is the closest";
            runs.push(("resolution-only", series, (!is_met).then_some(closest)));
        }
        if is_all {
            runs.push(("default", fixed(self.default), None));
            if let Some((settings, _)) = best_of(record.table.means(), budget) {
                runs.push(("best-constant", fixed(settings), Some("tuned on this path")));
            }
            if let Some(mut mixed) = mixed_constants(&record.table, budget) {
                let remark = "two constants in turns, tuned on this path";
                runs.push(("mixed-constants", self.play(&mut mixed, budget), Some(remark)));
            }
        }
        let trained = self.map.shared.points().iter().map(|point| (point.settings, point.cost));
        if let Some((settings, _)) = best_of(trained, budget) {
            runs.push((TRAINED, fixed(settings), Some("tuned on the training cameras")));
        }
        if is_all {
            let one = OneFrontier(self.map);
            let mut shared = Controller::new(&one, budget, self.lens, self.control);
            let series = self.play(&mut shared, budget);
            runs.push(("shared-frontier", series, Some("one frontier for all views")));
            let (mut plain, filtered) = self.oracles(budget);
            let remark = "knows the path in advance; settings are held for a second";
            runs.push(("oracle", self.play(&mut plain, budget), Some(remark)));
            runs.push(("oracle-filtered", filtered, Some("the same through the temporal filter")));
            let reactive = &mut Reactive::new(ladder(&self.map.shared), *budget);
            runs.push(("reactive", self.play(reactive, budget), None));
        }
        runs
    }

    /// The oracle, and the run of an oracle through the temporal filter.
    fn oracles(&self, budget: &ResolvedBudget) -> (Oracle, Vec<FrameRecord>) {
        let record = self.record;
        let keeps = |series: &[FrameRecord]| {
            budget.keeps(
                mean_power(series),
                if budget.power_w.is_some() { 0.0 } else { mean_error(series) },
            )
        };
        let hold = (record.path.fps().round() as usize).max(1);
        let plain = oracle(&record.table, budget, hold, &mut |oracle| {
            keeps(&record.simulate(&mut oracle.clone()))
        });
        let filtered = |oracle: &Oracle| {
            let mut oracle = oracle.clone();
            let mut filter = SettingsFilter::default();
            let mut through = move |frame: usize, dt: f64, pose: &Pose| {
                let target = oracle.decide(frame, dt, pose).settings;
                let settings = filter.step(&record.space, target, dt, self.control.transition);
                Choice { settings, target, predicted: None }
            };
            record.simulate_for(&mut through, 0.0)
        };
        let through = oracle(&record.table, budget, hold, &mut |oracle| keeps(&filtered(oracle)));
        (plain, filtered(&through))
    }
}

/// A map of one frontier for all views: that over all training cameras.
struct OneFrontier<'a>(&'a FrontierMap);

impl FrontierStore for OneFrontier<'_> {
    fn look_up(&self, _: &CameraView) -> Option<SampleRef<'_>> {
        let direction = ViewDirection::PositiveX;
        let camera = SampleCamera { corner: 0, position: glam::Vec3::ZERO, direction };
        let frontier = &self.0.shared;
        (!frontier.is_empty()).then_some(SampleRef { camera, frontier })
    }

    fn knobs(&self) -> &KnobSpace {
        &self.0.knobs
    }

    fn error_target(&self, budget: f64) -> Option<f64> {
        self.0.error_target(budget)
    }
}

/// Name, frames and remark of a run.
type Run = (&'static str, Vec<FrameRecord>, Option<&'static str>);

/// The second half of a long play with an error meter, its own power included. `best`: power of the best
/// settings.
fn measured(record: &PathRecord, mut controller: Controller<'_>, best: Watts) -> Vec<FrameRecord> {
    record.simulate_for(&mut controller, PLAYED_SECONDS);
    let before = controller.measurements;
    let mut series = record.simulate_for(&mut controller, PLAYED_SECONDS);
    // Power is that of the recorded rate whatever is drawn, so that a frame's energy is a share of it.
    let seconds = series.len() as f64 / record.path.fps();
    let share = METER_FRAMES * f64::from(controller.measurements - before) / (seconds * METER_FPS);
    for frame in &mut series {
        frame.power.0 += share * best.0;
    }
    series
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;

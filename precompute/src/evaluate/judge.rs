//! Comparison of all policies under one budget, simulated from a record.

use bevy_frugal_gi::control::{Budget, ControlSettings, SettingsFilter};
use bevy_frugal_gi::frontier::{CostPoint, FrontierMap};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use bevy_frugal_gi::units::Watts;

use super::baselines::{Oracle, Reactive, best_constant, best_on, ladder, oracle};
use super::bootstrap::dominates;
use super::runner::ELSEWHERE;
use super::{
    BudgetRequest, Choice, Controlled, Controller, Fixed, FrameRecord, PathRecord, Policy, Pose,
    RESOLUTION_KNOB, ResolvedBudget, RunResult,
};
use crate::default_settings::default_settings;

/// One budget on one path.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Judged {
    /// The requested limits, in words.
    pub asked: String,
    /// The limits in absolute terms.
    pub budget: ResolvedBudget,
    /// Every run, the frugal run first.
    pub runs: Vec<RunResult>,
    /// Share of the difference between the best constant and the oracle that the frugal run gains:
    /// of error under a power budget, of power under an error budget. `None` where the difference
    /// is negligible, or one of the three exceeds the budget.
    pub gap_closed: Option<f64>,
    /// Baselines with no more information than the frugal run that dominate it, with 95 %
    /// confidence.
    pub dominated_by: Vec<String>,
}

/// Baselines that have no more information about the path than the frugal run.
const FAIR: [&str; 4] = [ELSEWHERE, "reactive", "default", "resolution-only"];

/// Play that counts, and before that, seconds.
const PLAYED_SECONDS: f64 = 1200.0;
/// What a measurement costs, in frames of the best settings (`make bench BENCH=error_meter`).
const METER_FRAMES: f64 = 5.0;
/// Frame rate at which the meter's cost is spread, hertz. Recorded paths have fewer frames a second.
const METER_FPS: f64 = 60.0;
/// Most walks along a path in that time.
const MAX_WALKS: f64 = 400.0;

/// Settings to record for all runs: those of the map, the presets, and those with only the
/// resolution or the share of GI pixels lowered.
pub(crate) fn settings_to_record(map: &FrontierMap) -> Vec<KnobLevels> {
    let space = &map.knobs;
    let mut all = vec![space.highest(), space.lowest(), default_settings(space)];
    all.extend([2.0 / 3.0, 1.0 / 3.0].map(|share| space.preset(share)));
    all.extend(resolutions(space));
    all.extend(hand_written(space));
    all.extend(map.settings());
    space.canonical_once(all)
}

/// Hand-written constants: all knobs at their best, indirect light gathered at fewer pixels.
fn hand_written(space: &KnobSpace) -> Vec<KnobLevels> {
    let Some(knob) = space.index_of("gi_pixel_fraction") else { return Vec::new() };
    (0..space.knobs()[knob].levels.len())
        .map(|level| space.highest().with_level(knob, level))
        .collect()
}

fn resolutions(space: &KnobSpace) -> Vec<KnobLevels> {
    let Some(knob) = space.index_of(RESOLUTION_KNOB) else { return Vec::new() };
    (0..space.knobs()[knob].levels.len())
        .map(|level| space.canonical(space.highest().with_level(knob, level)))
        .collect()
}

/// Simulates all runs. `lens`: vertical field of view in radians, and width ÷ height. `control`:
/// time constants of the temporal filter, for the frugal run and the filtered oracle.
pub(crate) fn judge(
    record: &PathRecord,
    map: &FrontierMap,
    lens: (f32, f32),
    request: &BudgetRequest,
    control: ControlSettings,
) -> Judged {
    let space = &record.space;
    let fixed = |settings: KnobLevels| record.simulate(&mut Fixed(settings));
    let mean = |settings: KnobLevels| {
        let column = record.table.column(space.canonical(settings));
        column
            .and_then(|column| record.table.mean(column, 0..record.table.rows()))
            .unwrap_or(CostPoint::new(f64::NAN, f64::NAN))
    };
    let (lowest, highest) = (mean(space.lowest()), mean(space.highest()));
    let budget = request.resolve(lowest.power, highest.power);

    let mut runs: Vec<(&str, Vec<FrameRecord>, Option<String>)> = vec![
        ("frugal", record.simulate(&mut Controller::new(map, &budget, lens, control)), None),
        ("maximum", fixed(space.highest()), None),
        ("max-mid", fixed(space.preset(2.0 / 3.0)), None),
        ("mid-min", fixed(space.preset(1.0 / 3.0)), None),
        ("minimum", fixed(space.lowest()), None),
    ];
    if budget.error.is_some() {
        let controller = Controller::new(map, &budget, lens, control);
        let note = "twenty minutes after twenty others, with an error meter and its power";
        runs.push((
            "frugal-measured",
            measured(record, controller, highest.power),
            Some(note.to_owned()),
        ));
    }
    let scaled = resolutions(space);
    let scaled = record.table.with_columns(|settings| scaled.contains(&settings));
    if let Some((settings, _)) = best_constant(&scaled, &budget) {
        runs.push(("resolution-only", fixed(settings), None));
    }
    runs.push(("default", fixed(default_settings(space)), None));
    if let Some((settings, _)) = best_constant(&record.table, &budget) {
        runs.push(("best-constant", fixed(settings), Some("tuned on this path".to_owned())));
    }
    if let Some(settings) = best_on(&map.shared, &budget) {
        runs.push((ELSEWHERE, fixed(settings), Some("tuned on the training cameras".to_owned())));
    }
    let (plain, filtered) = oracles(record, &budget, control);
    runs.push((
        "oracle",
        record.simulate(&mut plain.clone()),
        Some("knows every frame in advance".to_owned()),
    ));
    runs.push((
        "oracle-filtered",
        filtered,
        Some("the same through the temporal filter".to_owned()),
    ));
    runs.push(("reactive", record.simulate(&mut Reactive::new(ladder(&map.shared), budget)), None));

    let fps = record.path.fps();
    let ours = runs[0].1.clone();
    let dominated_by = runs.iter().filter(|(name, ..)| FAIR.contains(name));
    let dominated_by = dominated_by
        .filter(|(_, series, _)| dominates(series, &ours, fps))
        .map(|(name, ..)| (*name).to_owned())
        .collect();
    let runs: Vec<RunResult> = runs
        .into_iter()
        .map(|(name, series, note)| RunResult {
            note,
            ..RunResult::new(name, series, &budget, space).with_windows(&budget, fps)
        })
        .collect();
    let gap_closed = gap(&runs, &budget);
    Judged { asked: request.to_string(), budget, runs, gap_closed, dominated_by }
}

/// The mean of some walks along the path and back after as many others, with an error meter. A
/// single walk's mean is off by what the next one makes good. A walk goes on where the last one
/// ended: from the end of a path straight to its start was 13 m in a frame of 0.1 s, which is no cut
/// but fast motion, and each start was played with the settings of the end. `best`: power of the
/// best settings.
fn measured(record: &PathRecord, controller: Controller<'_>, best: Watts) -> Vec<FrameRecord> {
    let mut controller = controller.measuring();
    let seconds = 2.0 * record.path.poses().len() as f64 / record.path.fps();
    let walks = (PLAYED_SECONDS / seconds).ceil().clamp(1.0, MAX_WALKS);
    for _ in 0..walks as u32 {
        record.simulate_return(&mut controller);
    }
    let before = controller.measurements();
    let [mut mean, back] = record.simulate_return(&mut controller);
    let further = (1..walks as u32).flat_map(|_| record.simulate_return(&mut controller));
    for (done, frames) in (1..).zip(std::iter::once(back).chain(further)) {
        let share = f64::from(done + 1).recip();
        for (mean, frame) in mean.iter_mut().zip(frames) {
            mean.power.0 += share * (frame.power.0 - mean.power.0);
            mean.error += share * (frame.error - mean.error);
        }
    }
    // Power is that of the recorded rate whatever is drawn, so that a frame's energy is a share of it.
    let share = METER_FRAMES * f64::from(controller.measurements() - before)
        / (f64::from(walks as u32) * seconds * METER_FPS);
    for frame in &mut mean {
        frame.power.0 += share * best.0;
    }
    mean
}

/// The oracle, and the run of an oracle through the temporal filter.
fn oracles(
    record: &PathRecord,
    budget: &ResolvedBudget,
    control: ControlSettings,
) -> (Oracle, Vec<FrameRecord>) {
    let limit = budget.error.unwrap_or(f64::INFINITY);
    let mean_error = |series: &[FrameRecord]| {
        series.iter().map(|frame| frame.error).sum::<f64>() / series.len().max(1) as f64
    };
    let plain = oracle(&record.table, budget, &mut |oracle| {
        mean_error(&record.simulate(&mut oracle.clone())) <= limit
    });
    let filtered = |oracle: &Oracle| {
        let mut oracle = oracle.clone();
        let mut filter = SettingsFilter::default();
        let times = control.times(&Budget::new(budget.power_w, budget.error));
        record.simulate(&mut Controlled(move |frame: usize, dt: f64, pose: &Pose| {
            let target = oracle.decide(frame, dt, pose).settings;
            Choice {
                settings: filter.step(&record.space, target, dt, times),
                target,
                predicted: None,
            }
        }))
    };
    let through =
        oracle(&record.table, budget, &mut |oracle| mean_error(&filtered(oracle)) <= limit);
    (plain, filtered(&through))
}

fn gap(runs: &[RunResult], budget: &ResolvedBudget) -> Option<f64> {
    let find = |name: &str| runs.iter().find(|run| run.name == name);
    let (ours, constant, oracle) = (find("frugal")?, find("best-constant")?, find("oracle")?);
    if !ours.met || !constant.met || !oracle.met {
        return None;
    }
    let value = |run: &RunResult| {
        if budget.power_w.is_some() { run.mean_error } else { run.mean_power_w.0 }
    };
    let (ours, constant, oracle) = (value(ours), value(constant), value(oracle));
    let least = if budget.power_w.is_some() { 1e-4 } else { 1e-3 * constant };
    (constant - oracle > least).then(|| (constant - ours) / (constant - oracle))
}

//! Sweep of all combinations of the global illumination's levels: dominance of levels.

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};
use frugal_trace::metrics::{Difference, Radiance};

use super::{Arguments, is_gi, is_still};
use crate::cli::arguments::{write, write_report};
use crate::cli::{CliError, progress};
use crate::report::{Report, ReportError, SweepSummary, sweep_section};
use crate::search::{LevelDominance, level_dominance};
use crate::stage::Stage;
use crate::table::{SweepFacts, SweepTable};

/// Frames metered for each combination.
const METERED_FRAMES: u32 = 2;

/// Measures all combinations at the stage's camera, prints the dominance of levels, and writes
/// table and page on request. Power is that which global illumination adds; error is the relative
/// L1 of 4 × 4 means against `reference`.
pub(super) fn run(
    stage: &mut Stage,
    reference: &Radiance,
    without: KnobLevels,
    scene: &str,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let space = stage.space().as_ref().clone();
    let table = measure(stage, reference, without, &combinations(&space)?)?;
    let dominances: Vec<LevelDominance> = level_dominance(&space, &table)
        .into_iter()
        .filter(|dominance| is_gi(&dominance.knob) && !is_still(&dominance.knob))
        .collect();
    print_dominances(&dominances, table.len());
    let points: Vec<_> =
        table.into_iter().map(|(settings, cost)| FrontierPoint { settings, cost }).collect();
    if let Some(path) = &arguments.csv {
        // Power is that which global illumination adds, not that of whole frames, so the table
        // omits their size.
        let facts = SweepFacts {
            scene: Some(scene.to_owned()),
            meter: Some(stage.meter()),
            ..SweepFacts::default()
        };
        let mut text = Vec::new();
        SweepTable { facts, space: space.clone(), points: points.clone() }
            .write(&mut text)
            .map_err(CliError::failed)?;
        write(path, &text)?;
    }
    if let Some(folder) = &arguments.report {
        let summary = SweepSummary {
            scene,
            space: &space,
            points: &points,
            error: "the relative L1 of means over 4 × 4 pixels of indirect light, against one path-traced bounce; power is what global illumination adds",
            meter: &stage.meter(),
            size: arguments.size.to_array(),
            fps: stage.options().frames_per_second,
            position: arguments.camera.position,
            look_at: arguments.camera.look_at,
        };
        write_report(folder, &page(&summary, &dominances)?)?;
    }
    Ok(())
}

/// Power that global illumination adds, and error, of all `combinations`. `without`: settings
/// without global illumination.
fn measure(
    stage: &mut Stage,
    reference: &Radiance,
    without: KnobLevels,
    combinations: &[KnobLevels],
) -> Result<Vec<(KnobLevels, CostPoint)>, CliError> {
    let bar = progress::bar(combinations.len() as u64).with_message("combinations");
    let mut table = Vec::new();
    let reading = |stage: &mut Stage, settings: KnobLevels| -> Result<f64, CliError> {
        if progress::interrupted() {
            return Err(CliError::failed("interrupted: nothing was written"));
        }
        stage.apply(settings);
        // All pipelines are compiled: one frame applies the settings.
        stage.frame();
        Ok(stage.metered_frames(METERED_FRAMES)?.0)
    };
    for chunk in combinations.chunks(32) {
        // Repeated, because the machine drifts.
        let off = reading(stage, without)?;
        for settings in chunk {
            let power = reading(stage, *settings)? - off;
            let difference =
                Difference::new(&stage.radiance()?, reference, None).map_err(CliError::usage)?;
            table.push((*settings, CostPoint::new(power, difference.relative_l1_boxes)));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(table)
}

fn print_dominances(dominances: &[LevelDominance], combinations: usize) {
    println!(
        "{combinations} combinations of the global illumination's levels; cost in watts that it adds, error against the reference"
    );
    println!("{:20} {:>8} {:>14} {:>12}", "knob", "level", "Pareto-optimal", "dominated by");
    for dominance in dominances {
        println!(
            "{:20} {:>8} {:14} {:12.3}",
            dominance.knob, dominance.label, dominance.non_dominated, dominance.dominated_by
        );
    }
}

/// The page: the cloud of combinations, and the dominance of levels.
fn page(summary: &SweepSummary<'_>, dominances: &[LevelDominance]) -> Result<String, ReportError> {
    let row = |dominance: &LevelDominance| {
        vec![
            dominance.knob.clone(),
            dominance.label.clone(),
            dominance.non_dominated.to_string(),
            format!("{:.3}", dominance.dominated_by),
        ]
    };
    let headers = [
        "knob",
        "level",
        "Pareto-optimal combinations with it",
        "its best combination is dominated by a factor of",
    ]
    .map(String::from);
    let mut section = sweep_section(summary)?;
    section.table("Level dominance", &headers, &dominances.iter().map(row).collect::<Vec<_>>());
    let title = format!("Every combination of global illumination's levels in {}", summary.scene);
    let mut report = Report::new(&title);
    report.section(section);
    Ok(report.render())
}

/// All combinations of global illumination's levels with it on, the other knobs at their best.
fn combinations(whole: &KnobSpace) -> Result<Vec<KnobLevels>, CliError> {
    let knobs: Vec<_> = whole
        .knobs()
        .iter()
        .filter(|knob| is_gi(&knob.name) && !is_still(&knob.name))
        .cloned()
        .collect();
    let knob_indices: Vec<_> = knobs.iter().filter_map(|knob| whole.index_of(&knob.name)).collect();
    let count = knobs.iter().position(|knob| knob.name == "gi_vpl_count");
    let space = KnobSpace::new(knobs).map_err(CliError::failed)?;
    let on = space.iter().filter(|settings| count.is_none_or(|index| settings.level(index) > 0));
    let lift = |settings: KnobLevels| {
        let lifted =
            knob_indices.iter().enumerate().map(|(own, index)| (*index, settings.level(own)));
        lifted.fold(whole.highest(), |all, (index, level)| all.with_level(index, level))
    };
    Ok(on.map(lift).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_combinations_of_levels_occur_and_other_knobs_stay_at_their_best() {
        let whole = crate::stage::knobs().unwrap();
        let all = combinations(&whole).unwrap();
        assert_eq!(all.len(), 7 * 3 * 3 * 4 * 3);
        let antialiasing = whole.index_of("antialiasing").unwrap();
        assert!(all.iter().all(|settings| settings.level(antialiasing) == whole.highest().level(antialiasing)));
        assert!(all.contains(&whole.highest()));
    }
}

//! Every combination of the global illumination's levels: which levels are worth having at all.

use bevy_frugal_gi::frontier::{CostPoint, FrontierPoint};
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};

use super::{Arguments, is_gi, is_still};
use crate::cli::arguments::{write, write_report};
use crate::cli::{CliError, progress};
use crate::metrics::{Difference, Radiance};
use crate::report::{Report, SweepSummary, sweep_section};
use crate::search::{LevelDominance, level_dominance};
use crate::stage::Stage;
use crate::table::{SweepFacts, SweepTable};

/// Frames metered for each combination.
const METERED_FRAMES: u32 = 2;

/// Measures all of them at the stage's camera, prints what each level is good for, and writes table
/// and page, if asked to: power that the global illumination adds, and the relative L1 of 4 × 4
/// means against `truth` as the error.
pub(super) fn run(
    stage: &mut Stage,
    truth: &Radiance,
    without: RenderSettings,
    scene: &str,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let whole = stage.space().as_ref().clone();
    let wanted = combinations(&whole)?;
    let bar = progress::bar(wanted.len() as u64).with_message("combinations");
    let mut table = Vec::new();
    let reading = |stage: &mut Stage, settings: RenderSettings| -> Result<f64, CliError> {
        if progress::interrupted() {
            return Err(CliError::failed("interrupted: nothing was written"));
        }
        stage.apply(settings);
        // All is compiled: one frame brings it in.
        stage.frame();
        Ok(stage.metered_frames(METERED_FRAMES)?.0)
    };
    for chunk in wanted.chunks(32) {
        // Again and again, since the machine drifts.
        let off = reading(stage, without)?;
        for settings in chunk {
            let power = reading(stage, *settings)? - off;
            let difference =
                Difference::new(&stage.radiance()?, truth, None).map_err(CliError::usage)?;
            table.push((*settings, CostPoint::new(power, difference.relative_l1_boxes)));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();

    println!(
        "{} combinations of the global illumination's levels; cost in watts that it adds, error against the truth",
        table.len()
    );
    println!("{:20} {:>8} {:>14} {:>12}", "knob", "level", "Pareto-optimal", "dominated by");
    let worths = level_dominance(&whole, &table)
        .into_iter()
        .filter(|worth| is_gi(&worth.knob) && !is_still(&worth.knob));
    let worths: Vec<LevelDominance> = worths.collect();
    for worth in &worths {
        println!(
            "{:20} {:>8} {:14} {:12.3}",
            worth.knob, worth.label, worth.non_dominated, worth.dominated_by
        );
    }
    let points: Vec<_> =
        table.into_iter().map(|(settings, cost)| FrontierPoint { settings, cost }).collect();
    if let Some(path) = &arguments.csv {
        // Power is what global illumination adds, and not that of whole frames: their size has no
        // place in the table.
        let facts = SweepFacts {
            scene: Some(scene.to_owned()),
            meter: Some(stage.meter()),
            ..SweepFacts::default()
        };
        let mut text = Vec::new();
        SweepTable { facts, space: whole.clone(), points: points.clone() }
            .write(&mut text)
            .map_err(CliError::failed)?;
        write(path, &text)?;
    }
    if let Some(folder) = &arguments.report {
        let summary = SweepSummary {
            scene,
            space: &whole,
            points: &points,
            error: "the relative L1 of means over 4 × 4 pixels of indirect light, against one path-traced bounce; power is what global illumination adds",
            meter: &stage.meter(),
            size: arguments.size.to_array(),
            fps: stage.options().frames_per_second,
            position: arguments.camera.position,
            look_at: arguments.camera.look_at,
        };
        let mut section = sweep_section(&summary)?;
        let row = |worth: &LevelDominance| {
            vec![
                worth.knob.clone(),
                worth.label.clone(),
                worth.non_dominated.to_string(),
                format!("{:.3}", worth.dominated_by),
            ]
        };
        let headers = [
            "knob",
            "level",
            "of the frontier have it",
            "its best combination is beaten by a factor of",
        ]
        .map(String::from);
        section.table(
            "What levels are worth",
            &headers,
            &worths.iter().map(row).collect::<Vec<_>>(),
        );
        let mut report =
            Report::new(&format!("Every combination of global illumination's levels in {scene}"));
        report.section(section);
        write_report(folder, &report.render())?;
    }
    Ok(())
}

/// All levels of all knobs that make global illumination where it is on, the other knobs at their
/// best.
fn combinations(whole: &KnobSpace) -> Result<Vec<RenderSettings>, CliError> {
    let knobs: Vec<_> = whole
        .knobs()
        .iter()
        .filter(|knob| is_gi(&knob.name) && !is_still(&knob.name))
        .cloned()
        .collect();
    let places: Vec<_> = knobs.iter().filter_map(|knob| whole.index_of(&knob.name)).collect();
    let count = knobs.iter().position(|knob| knob.name == "gi_vpl_count");
    let space = KnobSpace::new(knobs).map_err(CliError::failed)?;
    let on = space.iter().filter(|settings| count.is_none_or(|index| settings.level(index) > 0));
    let lift = |settings: RenderSettings| {
        let lifted =
            places.iter().enumerate().map(|(index, place)| (*place, settings.level(index)));
        lifted.fold(whole.highest(), |all, (place, level)| all.with_level(place, level))
    };
    Ok(on.map(lift).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_levels_meet_all_others_and_other_knobs_stay_at_their_best() {
        let whole = crate::stage::knobs().unwrap();
        let all = combinations(&whole).unwrap();
        assert_eq!(all.len(), 7 * 3 * 3 * 4 * 3);
        let antialiasing = whole.index_of("antialiasing").unwrap();
        assert!(all.iter().all(|settings| settings.level(antialiasing) == whole.highest().level(antialiasing)));
        assert!(all.contains(&whole.highest()));
    }
}

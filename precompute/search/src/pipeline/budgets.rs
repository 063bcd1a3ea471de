//! Calibration of error budgets by a search's cameras.

use frugal_core::frontier::{CameraView, ErrorRates, Frontier, look_up_in};
use frugal_core::knobs::KnobLevels;

use super::{PlayShare, Subject};
use crate::cameras::{CameraSet, MovingCamera};
use crate::fit::{Calibration, Fitted, calibrate};
use crate::table::CostTable;

/// Cameras of tracks that are enough to calibrate by them alone.
const ENOUGH_ON_TRACKS: usize = 20;

/// A camera by which error budgets are calibrated.
struct Judge<'a> {
    camera: MovingCamera,
    /// Its frontier by cameras without it.
    frontier: &'a Frontier,
    /// Its errors, and its row there.
    table: &'a CostTable,
    row: usize,
    /// Whether it has rendered the whole pool.
    is_full: bool,
}

/// Costs by which error budgets are calibrated.
pub(super) struct Evidence<'a> {
    /// At the training cameras.
    pub training: &'a CostTable,
    /// Numbers of those in the fit.
    pub rows: &'a [usize],
    /// Whether a training camera has rendered the whole pool.
    pub is_full: &'a dyn Fn(usize) -> bool,
    /// At the calibration cameras.
    pub calibration: &'a CostTable,
}

/// Calibrates error budgets: by cameras of tracks where there are enough, since these are the views
/// that users play, and by all else.
///
/// Where there are enough, only cameras that have rendered the whole pool take part: completed errors
/// share the prediction's bias.
pub(super) fn calibrated(
    subject: &Subject<'_>,
    cameras: &CameraSet,
    fitted: &Fitted,
    evidence: &Evidence<'_>,
    played: &PlayShare,
) -> ErrorRates {
    let Evidence { training, rows, is_full, calibration } = *evidence;
    let error = |table: &'_ CostTable, row: usize, settings: KnobLevels| {
        Some(table.get(row, settings)?.error)
    };
    let views = views(&cameras.calibration, subject.lens);
    let apart = views.iter().enumerate().take(calibration.rows()).filter_map(|(row, view)| {
        let frontier = look_up_in(&fitted.octree, subject.bounds, view)?.frontier;
        let camera = cameras.calibration[row];
        Some(Judge { camera, frontier, table: calibration, row, is_full: true })
    });
    let crossed = fitted.held_out.iter().zip(rows).map(|(frontier, row)| Judge {
        camera: cameras.training[*row],
        frontier,
        table: training,
        row: *row,
        is_full: is_full(*row),
    });
    let mut all: Vec<Judge<'_>> =
        apart.chain(crossed).filter(|judge| !judge.frontier.is_empty()).collect();
    let on_track = |judge: &Judge<'_>| judge.camera.is_on_track();
    if all.iter().filter(|judge| judge.is_full && on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(|judge| judge.is_full);
    }
    if all.iter().filter(|judge| on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(on_track);
    }
    // Groups are numbered along tracks.
    all.sort_by_key(|judge| judge.camera.group);
    let all: Vec<_> = all
        .into_iter()
        .map(|Judge { frontier, table, row, .. }| {
            (frontier, move |settings: KnobLevels| error(table, row, settings))
        })
        .collect();
    let cameras: Vec<Calibration<'_>> =
        all.iter().map(|(frontier, error)| Calibration { frontier, error }).collect();
    calibrate(&cameras, &|error| played.uncertainty(error))
}

/// The views of cameras through a lens: vertical field of view in radians, and width ÷ height.
pub(super) fn views(cameras: &[MovingCamera], lens: (f32, f32)) -> Vec<CameraView> {
    let view = |camera: &MovingCamera| CameraView {
        position: camera.pose.position,
        rotation: camera.pose.rotation,
        vertical_fov: lens.0,
        aspect: lens.1,
    };
    cameras.iter().map(view).collect()
}

//! Calibration of error budgets by a search's cameras.

use frugal_core::frontier::{ErrorRates, look_up_in};
use frugal_core::knobs::KnobLevels;

use super::finish::Costs;
use super::{PlayShare, Subject};
use crate::cameras::{CameraSet, MovingCamera, view_from};
use crate::fit::{Calibration, Fitted, calibrate};

/// Cameras of tracks that are enough to calibrate by them alone.
const ENOUGH_ON_TRACKS: usize = 20;

/// A camera by which error budgets are calibrated.
struct Judge<'a> {
    camera: MovingCamera,
    /// Its frontier by cameras without it, and its errors.
    calibration: Calibration<'a>,
    /// Whether it has rendered the whole pool.
    is_full: bool,
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
    (costs, rows, pool): (&Costs, &[usize], &[KnobLevels]),
    played: &PlayShare,
) -> ErrorRates {
    let apart = (0..costs.calibration.rows()).filter_map(|row| {
        let camera = cameras.calibration[row];
        let view = view_from(&camera.pose, subject.lens);
        let frontier = look_up_in(&fitted.octree, subject.bounds, &view)?.frontier;
        let calibration = Calibration { frontier, table: &costs.calibration, row };
        Some(Judge { camera, calibration, is_full: true })
    });
    let crossed = fitted.held_out.iter().zip(rows).map(|(frontier, row)| Judge {
        camera: cameras.training[*row],
        calibration: Calibration { frontier, table: &costs.training, row: *row },
        is_full: pool.iter().all(|one| costs.rendered.get(*row, *one).is_some()),
    });
    let mut all: Vec<Judge<'_>> =
        apart.chain(crossed).filter(|judge| !judge.calibration.frontier.is_empty()).collect();
    let on_track = |judge: &Judge<'_>| judge.camera.is_on_track();
    if all.iter().filter(|judge| judge.is_full && on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(|judge| judge.is_full);
    }
    if all.iter().filter(|judge| on_track(judge)).count() >= ENOUGH_ON_TRACKS {
        all.retain(on_track);
    }
    // Groups are numbered along tracks.
    all.sort_by_key(|judge| judge.camera.group);
    let cameras: Vec<Calibration<'_>> = all.iter().map(|judge| judge.calibration).collect();
    calibrate(&cameras, &|error| played.uncertainty(error))
}

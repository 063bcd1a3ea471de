//! Plays a camera path, renders its record, and checks what is simulated from it.
//!
//! A [`FrameRenderer`] renders and meters; a [`Policy`] decides each frame's settings.
//! [`frugal_search::evaluate`] holds what needs no renderer.
//!
//! | part | job |
//! |---|---|
//! | `mod` | one run along a path: frame renderer, policy, per-frame records |
//! | `render_path` | makes a record of a path, with several renderers side by side |
//! | `check` | real plays beside the record: errors of simulation, drift |
//! | `table` | results as text, and per-frame CSV |

mod check;
mod render_path;
mod table;
#[cfg(test)]
pub(crate) mod testing;

use std::ops::ControlFlow;

use frugal_core::frontier::CostPoint;
use frugal_search::evaluate::{FrameRecord, PathPlan, Policy, Pose};
use frugal_search::pipeline::PipelineError;
use frugal_trace::metrics::{Picture, ssim};

use crate::scene::CameraPath;
use crate::stage::{FrameRenderer, StageError};
pub(crate) use check::play_for_real;
pub(crate) use render_path::extend;
pub(crate) use table::{TABLE_HEADERS, frames_csv, headline, notes, table, table_row};

/// A scene's path called `name`, from its start, at `fps` frames per second: at least one.
///
/// # Errors
/// As [`PathPlan::new`].
pub(crate) fn plan_along(name: &str, path: &CameraPath, fps: f64) -> Result<PathPlan, String> {
    let pose = |frame: usize| {
        path.sample(path.start() + (frame as f64 / fps) as f32)
            .unwrap_or(Pose { position: glam::Vec3::ZERO, rotation: glam::Quat::IDENTITY })
    };
    let frames = (f64::from(path.duration()) * fps).round().max(1.0) as usize;
    PathPlan::new(name, fps, (0..frames).map(pose))
}

/// Use of a run's images. References stay images, of 3 bytes per pixel: prepared ones take five times as
/// much, and those of a path do not fit into a laptop's memory.
enum Against<'a> {
    /// Stores them as the references.
    Collect(&'a mut Vec<Picture>),
    /// Compares them with these references.
    Compare(&'a [Picture]),
}

/// Plays all of `path`. `on_frame` is called after every frame and can stop the run.
fn play(
    renderer: &mut impl FrameRenderer,
    path: &PathPlan,
    name: &str,
    policy: &mut dyn Policy,
    mut against: Against<'_>,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<FrameRecord>, PipelineError> {
    let failed = |error: StageError| PipelineError::Measure(error.message);
    let dt = path.fps().recip();
    let mut records = Vec::with_capacity(path.poses().len());
    for (frame, pose) in path.poses().iter().enumerate() {
        let choice = policy.decide(frame, dt, pose);
        if frame == 0 {
            renderer.begin_run(pose, choice.settings).map_err(failed)?;
        }
        let (picture, power) = renderer.render_frame(pose, choice.settings).map_err(failed)?;
        let error = match &mut against {
            Against::Collect(references) => {
                references.push(picture);
                0.0
            }
            Against::Compare(references) => {
                ssim::error(&references[frame], &picture).map_err(|error| {
                    PipelineError::Measure(format!("run `{name}`, frame {frame}: {error}"))
                })?
            }
        };
        policy.observe(CostPoint::new(power.0, error));
        records.push(FrameRecord {
            time: frame as f64 * dt,
            settings: choice.settings,
            power,
            error,
            predicted: choice.predicted,
        });
        if on_frame().is_break() {
            return Err(PipelineError::Interrupted);
        }
    }
    Ok(records)
}

#[cfg(test)]
mod tests {
    use frugal_search::evaluate::Fixed;
    use frugal_search::testing::formula::{path, space};
    use glam::Vec3;

    use super::testing::Fake;
    use super::*;
    use crate::scene::CameraKey;

    #[test]
    fn references_of_a_path_take_three_bytes_a_pixel() {
        let mut references = Vec::new();
        let mut best = Fixed(space().highest());
        let against = Against::Collect(&mut references);
        play(&mut Fake::default(), &path(), "maximum", &mut best, against, &mut || {
            ControlFlow::Continue(())
        })
        .unwrap();
        let bytes: usize = references.iter().map(|it| size_of_val(&it.rgb[..])).sum();
        assert_eq!(bytes, path().poses().len() * 16 * 12 * 3);
    }

    #[test]
    fn a_path_has_as_many_frames_as_its_length_says() {
        let planned = |duration: f32, fps: f64| {
            let key = |time: f32| CameraKey {
                time: 3.0 + time,
                position: Vec3::X * time,
                look_at: Vec3::X * time + Vec3::NEG_Z,
            };
            let path = CameraPath { keys: vec![key(0.0), key(duration)] };
            plan_along("tour", &path, fps)
        };
        let frames = |duration, fps| planned(duration, fps).unwrap().poses().len();
        assert_eq!(frames(6.0, 30.0), 180);
        assert_eq!(frames(0.99, 2.0), 2);
        assert_eq!(frames(0.0, 30.0), 1, "a still camera is a path too");
        let path = planned(1.0, 4.0).unwrap();
        for (frame, pose) in path.poses().iter().enumerate() {
            assert!((pose.position.x - 0.25 * frame as f32).abs() < 1e-6, "{pose:?}");
        }
        assert!(planned(f32::MAX, 30.0).is_err());
    }
}

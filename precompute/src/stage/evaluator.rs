//! The stage as a search sees it: settings at a camera cost power and error.

use bevy::math::{Quat, Vec3};
use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;

use super::{Stage, StageError};
use crate::metrics::Reference;
use crate::scene::RayScene;
use crate::search::{Evaluate, SampleCamera};

/// Frames after a switch that are not metered: the first makes textures and pipelines.
const SETTLING_FRAMES: u32 = 1;

/// Frames of a first reading.
pub(super) const EVALUATING_FRAMES: u32 = 2;

/// Frames of a second, closer one. It replaces the first, which was selected for being low.
pub(super) const REFINING_FRAMES: u32 = 4;

/// Renders and meters on a [`Stage`], against the best settings' picture at the same camera.
pub struct StageEvaluator {
    stage: Stage,
    reference: Option<(Vec3, Quat, Reference)>,
}

impl StageEvaluator {
    /// An evaluator over `stage`.
    pub fn new(stage: Stage) -> Self {
        Self { stage, reference: None }
    }

    /// The stage.
    pub fn stage(&mut self) -> &mut Stage {
        &mut self.stage
    }

    /// Power and error of `settings` at a camera, metered over at least `frames` frames.
    ///
    /// # Errors
    /// When the rendering or the metering fails.
    pub fn measure(&mut self, position: Vec3, rotation: Quat, settings: RenderSettings, frames: u32) -> Result<CostPoint, StageError> {
        self.stage.place(position, rotation);
        if self.reference.as_ref().is_none_or(|(at, turned, _)| (*at, *turned) != (position, rotation)) {
            self.stage.apply(self.stage.space.highest());
            // The first shows the new place with what the old one left behind.
            self.stage.frame();
            self.stage.frame();
            self.reference = Some((position, rotation, Reference::new(&self.stage.picture()?)?));
        }
        self.stage.apply(settings);
        (0..SETTLING_FRAMES).for_each(|_| self.stage.frame());
        let power = self.stage.metered_frames(frames)?;
        let Some((_, _, reference)) = &self.reference else { return Ok(CostPoint { power, error: 0.0 }) };
        Ok(CostPoint { power, error: reference.error(&self.stage.picture()?)? })
    }
}

/// Whether a camera has geometry before it and none around it.
pub(crate) fn sees(rays: &RayScene, position: Vec3, rotation: Quat, vertical_fov_degrees: f32, aspect: f32) -> bool {
    rays.sees_geometry(position, rotation, vertical_fov_degrees.to_radians(), aspect) && !rays.inside_geometry(position)
}

impl Evaluate for StageEvaluator {
    type Error = StageError;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, StageError> {
        let size = self.stage.options.size.as_vec2();
        Ok(sees(&self.stage.rays, camera.position, camera.view.rotation(), self.stage.vertical_fov_degrees, size.x / size.y))
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, StageError> {
        self.measure(camera.position, camera.view.rotation(), settings, EVALUATING_FRAMES)
    }

    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, _: CostPoint) -> Result<CostPoint, StageError> {
        self.measure(camera.position, camera.view.rotation(), settings, REFINING_FRAMES)
    }
}

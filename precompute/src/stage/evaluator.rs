//! The stage as the search sees it: settings at a sample camera cost power and error.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::RenderSettings;
use bevy_frugal_gi::units::Watts;

use super::{Stage, StageError};
use crate::metrics::Reference;
use crate::search::{Evaluate, SampleCamera};

/// Frames after a switch that are not metered: the first makes textures and pipelines.
const SETTLING_FRAMES: u32 = 1;

/// Frames of a second, closer reading.
const REFINING_FRAMES: u32 = 6;

/// Renders and meters on a [`Stage`].
pub struct StageEvaluator<'s> {
    stage: &'s mut Stage,
    reference: Option<(SampleCamera, Reference)>,
}

impl<'s> StageEvaluator<'s> {
    /// An evaluator over `stage`.
    pub fn new(stage: &'s mut Stage) -> Self {
        Self { stage, reference: None }
    }

    /// The stage.
    pub fn stage(&mut self) -> &mut Stage {
        self.stage
    }

    /// Goes to `camera`, and renders its reference at the best settings where the last one was another's.
    fn visit(&mut self, camera: SampleCamera) -> Result<(), StageError> {
        if self.reference.as_ref().is_none_or(|(at, _)| *at != camera) {
            self.stage.place(camera.position, camera.view.rotation());
            self.stage.apply(self.stage.space.highest());
            // The first shows the new place with what the old one left behind.
            self.stage.frame();
            self.stage.frame();
            self.reference = Some((camera, Reference::new(&self.stage.picture()?)?));
        }
        Ok(())
    }

    fn error(&self) -> Result<f64, StageError> {
        let Some((_, reference)) = &self.reference else { return Ok(0.0) };
        Ok(reference.error(&self.stage.picture()?)?)
    }
}

impl Evaluate for StageEvaluator<'_> {
    type Error = StageError;

    fn sees(&mut self, camera: SampleCamera) -> Result<bool, StageError> {
        let rays = &self.stage.rays;
        let size = self.stage.options.size.as_vec2();
        let fov = self.stage.vertical_fov_degrees.to_radians();
        Ok(rays.sees_geometry(camera.position, camera.view.rotation(), fov, size.x / size.y) && !rays.inside_geometry(camera.position))
    }

    fn evaluate(&mut self, camera: SampleCamera, settings: RenderSettings) -> Result<CostPoint, StageError> {
        self.visit(camera)?;
        self.stage.apply(settings);
        (0..SETTLING_FRAMES).for_each(|_| self.stage.frame());
        let power = self.stage.metered_frames()?;
        Ok(CostPoint { power, error: self.error()? })
    }

    /// Meters longer, and joins both readings by their lengths: a frontier picks the luckiest readings, so its points must be read again.
    fn refine(&mut self, camera: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, StageError> {
        self.visit(camera)?;
        self.stage.apply(settings);
        (0..SETTLING_FRAMES).for_each(|_| self.stage.frame());
        let power = self.stage.metered_frames_at_least(REFINING_FRAMES)?;
        // The first reading was selected for being low; only the second is unbiased.
        Ok(CostPoint { power: Watts(power.0), error: so_far.error })
    }
}

//! Waits for everything that is compiled, loaded or built in the background, so that no metered frame
//! lacks it or pays for it.

use std::time::{Duration, Instant};

use bevy::render::render_resource::{CachedPipelineState, PipelineCache, PipelineDescriptor};
use bevy::shader::ShaderCacheError;

use super::{Stage, StageError};
use crate::gi::{GiCounts, GiOccluders, GiTextureCopies};
use crate::knobs::{KnobLevels, levels_to_show};

/// Greatest number of frames to wait for temporal accumulation.
const MAX_ACCUMULATION_FRAMES: u32 = 70;
/// Frames and time after which a renderer that is still not ready has failed: small images are fast,
/// and drivers may take seconds for a pipeline.
const MAX_FRAMES: u32 = 600;
const MAX_TIME: Duration = Duration::from_secs(120);
/// Renderings from a cut that are repeated because a pipeline was compiled meanwhile, at most.
const MOST_TRIES: usize = 8;
/// Loading and compiling run in other threads; frames of small images would leave them no time.
const YIELD: Duration = Duration::from_millis(5);

impl Stage {
    /// Renders frames until all pipelines and resources of the frame are ready.
    ///
    /// # Errors
    /// When a shader does not compile, the app ends, or it takes more than 600 frames and 120 s.
    pub fn get_ready(&mut self) -> Result<(), StageError> {
        let (start, mut frames, mut ready_frames) = (Instant::now(), 0, 0);
        while frames < MAX_FRAMES || start.elapsed() < MAX_TIME {
            self.frame();
            self.check()?;
            frames += 1;
            let world = self.app.world();
            let waiting = self.is_compiling()
                || world.get_resource::<GiOccluders>().is_some_and(|all| all.waiting() > 0)
                || world.get_resource::<GiTextureCopies>().is_some_and(|all| all.waiting() > 0);
            // The count lags a frame behind the image.
            ready_frames = if waiting { 0 } else { ready_frames + 1 };
            if ready_frames == 0 {
                std::thread::sleep(YIELD);
            }
            // Temporal accumulation still converges to the still image. In a scene that never rests
            // it never does.
            let accumulating = self
                .render_world()
                .get_resource::<GiCounts>()
                .is_some_and(|counts| counts.settling > 0 || counts.waiting_maps > 0);
            if ready_frames >= if accumulating { MAX_ACCUMULATION_FRAMES } else { 4 } {
                return Ok(());
            }
        }
        Err(self.still_missing())
    }

    /// Renders frames until no pipeline is missing.
    ///
    /// # Errors
    /// As [`get_ready`](Self::get_ready).
    pub(super) fn finish_pipelines(&mut self) -> Result<(), StageError> {
        let start = Instant::now();
        while self.is_compiling() {
            std::thread::sleep(YIELD);
            self.frame();
            self.check()?;
            if start.elapsed() > MAX_TIME {
                return Err(self.still_missing());
            }
        }
        Ok(())
    }

    /// What `render` returns after a cut to `settings`, and anew where a pipeline was compiled meanwhile:
    /// frames lacked it, of which samples and light keep traces.
    ///
    /// # Errors
    /// Those of `render`; as [`get_ready`](Self::get_ready); or when it never ends.
    pub(super) fn complete<T>(
        &mut self,
        settings: KnobLevels,
        mut render: impl FnMut(&mut Self) -> Result<T, StageError>,
    ) -> Result<T, StageError> {
        for _ in 0..MOST_TRIES {
            self.is_incomplete = false;
            self.apply(settings);
            let rendered = render(self)?;
            if !self.is_incomplete {
                return Ok(rendered);
            }
            self.finish_pipelines()?;
        }
        Err(StageError::not_ready(format!(
            "it compiled pipelines in each of {MOST_TRIES} renderings of the same frames"
        )))
    }

    /// Fails if a shader does not compile, or the app has ended.
    pub(super) fn check(&self) -> Result<(), StageError> {
        if self.has_ended {
            return Err(StageError::failed(StageError::ENDED));
        }
        for pipeline in self.render_world().resource::<PipelineCache>().pipelines() {
            if let CachedPipelineState::Err(error) = &pipeline.state
                // Shaders load in the background; Bevy retries in the next frame.
                && !matches!(error, ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable)
            {
                return Err(StageError::not_ready(error));
            }
        }
        Ok(())
    }

    fn still_missing(&self) -> StageError {
        let cache = self.render_world().resource::<PipelineCache>();
        let waiting = cache.pipelines().filter_map(|pipeline| match &pipeline.state {
            CachedPipelineState::Ok(_) => None,
            state => Some(format!("{} ({state:?})", label(&pipeline.descriptor))),
        });
        let waiting = waiting.collect::<Vec<_>>().join(", ");
        StageError::not_ready(format!(
            "after {} s these are still missing: {waiting}",
            MAX_TIME.as_secs()
        ))
    }

    /// Renders every level of every knob on offer once, so that all pipelines are compiled before
    /// anything is metered.
    ///
    /// # Errors
    /// When the renderer does not become ready.
    pub fn warm(&mut self) -> Result<(), StageError> {
        for settings in levels_to_show(&self.space) {
            self.apply(settings);
            self.frame();
            self.finish_pipelines()?;
        }
        self.apply(self.space.highest());
        self.get_ready()
    }
}

fn label(descriptor: &PipelineDescriptor) -> &str {
    let label = match descriptor {
        PipelineDescriptor::RenderPipelineDescriptor(descriptor) => descriptor.label.as_deref(),
        PipelineDescriptor::ComputePipelineDescriptor(descriptor) => descriptor.label.as_deref(),
    };
    label.unwrap_or("a pipeline without a name")
}

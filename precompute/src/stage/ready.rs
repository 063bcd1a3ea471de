//! Waits for everything that is compiled, loaded or built in the background, so that no metered frame
//! lacks it or pays for it.

use std::sync::Arc;
use std::time::Duration;

use bevy::render::render_resource::{CachedPipelineState, PipelineCache, PipelineDescriptor};
use bevy::shader::ShaderCacheError;
use bevy_frugal_gi::gi::{GiCounts, GiOccluders, GiTextureCopies};

use super::{Stage, StageError};

/// Greatest number of frames to wait for temporal accumulation.
const MAX_ACCUMULATION_FRAMES: u32 = 70;
/// Frames after which a renderer that is still not ready has failed.
const MAX_FRAMES: u32 = 600;

impl Stage {
    /// Renders frames until all pipelines and resources of the frame are ready.
    ///
    /// # Errors
    /// When a shader does not compile, or it takes more than 600 frames.
    pub fn get_ready(&mut self) -> Result<(), StageError> {
        let mut ready_frames = 0;
        for _ in 0..MAX_FRAMES {
            self.frame();
            let cache = self.render_world().resource::<PipelineCache>();
            for pipeline in cache.pipelines() {
                if let CachedPipelineState::Err(error) = &pipeline.state
                    // Shaders load in the background; Bevy retries in the next frame.
                    && !matches!(error, ShaderCacheError::ShaderNotLoaded(_) | ShaderCacheError::ShaderImportNotYetAvailable)
                {
                    return Err(StageError::NotReady(error.to_string()));
                }
            }
            let waiting = cache.waiting_pipelines().next().is_some()
                || self.app.world().resource::<GiOccluders>().waiting() > 0
                || self.app.world().resource::<GiTextureCopies>().waiting() > 0;
            // The count lags a frame behind the image.
            ready_frames = if waiting { 0 } else { ready_frames + 1 };
            if ready_frames == 0 {
                // Loading runs in other threads; frames of small images would leave it no time.
                std::thread::sleep(Duration::from_millis(5));
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
        let waiting =
            self.render_world().resource::<PipelineCache>().pipelines().filter_map(|pipeline| {
                match &pipeline.state {
                    CachedPipelineState::Ok(_) => None,
                    state => Some(format!("{} ({state:?})", label(&pipeline.descriptor))),
                }
            });
        Err(StageError::NotReady(format!(
            "after {MAX_FRAMES} frames these are still missing: {}",
            waiting.collect::<Vec<_>>().join(", ")
        )))
    }

    /// Renders every level of every knob on offer once, so that all pipelines are compiled before
    /// anything is metered.
    ///
    /// # Errors
    /// When the renderer does not become ready.
    pub fn warm(&mut self) -> Result<(), StageError> {
        // The other knobs are at their cheapest, which is fast. A knob that depends on another is
        // rendered with each of the other's levels, because a pipeline may be specific to a pair.
        let space = Arc::clone(&self.space);
        for (index, knob) in space.knobs().iter().enumerate() {
            for base in space.cheapest_with(knob) {
                for level in 0..knob.levels.len() {
                    self.apply(base.with_level(index, level));
                    self.frame();
                }
            }
        }
        self.apply(space.highest());
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

//! Whether the renderer still has pipelines to compile, told to the main world.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::app::App;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderSystems};

/// In both worlds; the render world writes it at the end of each of its frames. Without a renderer
/// there is none of this, and nothing to wait for.
#[derive(Resource, Clone, Debug)]
pub(crate) struct PipelinesBusy(Arc<AtomicBool>);

impl PipelinesBusy {
    /// One that says `busy`, for tests without a renderer.
    #[cfg(test)]
    pub(crate) fn new(busy: bool) -> Self {
        Self(Arc::new(AtomicBool::new(busy)))
    }

    /// For tests without a renderer.
    #[cfg(test)]
    pub(crate) fn set(&self, busy: bool) {
        self.0.store(busy, Ordering::Relaxed);
    }

    /// As of the last frame that was rendered.
    pub(crate) fn get(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Adds [`PipelinesBusy`]; once is enough. To be called when plugins finish.
pub(crate) fn finish(app: &mut App) {
    if app.world().contains_resource::<PipelinesBusy>() {
        return;
    }
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    // Busy until the renderer says otherwise.
    let busy = PipelinesBusy(Arc::new(AtomicBool::new(true)));
    render_app.insert_resource(busy.clone()).add_systems(
        Render,
        tell_whether_busy.in_set(RenderSystems::Cleanup).run_if(resource_exists::<PipelineCache>),
    );
    app.insert_resource(busy);
}

fn tell_whether_busy(cache: Res<PipelineCache>, busy: Res<PipelinesBusy>) {
    busy.0.store(cache.waiting_pipelines().next().is_some(), Ordering::Relaxed);
}

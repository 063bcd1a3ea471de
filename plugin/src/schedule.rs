//! What more than one part of the plugin waits for: settings being applied, pipelines being compiled.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::app::App;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::{Render, RenderApp, RenderSystems};

/// Where settings are applied.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum KnobSystems {
    /// In `PostUpdate`, before cameras are updated: a level set before it is in the frame's image.
    Apply,
}

/// Whether pipelines are pending; shared by both worlds, written by the render world at the end of
/// each frame. Absent in an app without a renderer, where nothing compiles.
#[derive(Resource, Clone, Debug)]
pub(crate) struct PipelinesBusy(Arc<AtomicBool>);

impl PipelinesBusy {
    /// A fixed state, for tests without a renderer.
    #[cfg(test)]
    pub(crate) fn new(busy: bool) -> Self {
        Self(Arc::new(AtomicBool::new(busy)))
    }

    /// Sets the state, for tests without a renderer.
    #[cfg(test)]
    pub(crate) fn set(&self, busy: bool) {
        self.0.store(busy, Ordering::Relaxed);
    }

    /// State after the last rendered frame.
    pub(crate) fn get(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Adds [`PipelinesBusy`] unless it exists. Called from `Plugin::finish`.
pub(crate) fn watch_pipelines(app: &mut App) {
    if app.world().contains_resource::<PipelinesBusy>() {
        return;
    }
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    // Busy until the renderer reports otherwise.
    let busy = PipelinesBusy(Arc::new(AtomicBool::new(true)));
    render_app.insert_resource(busy.clone()).add_systems(
        Render,
        update_busy.in_set(RenderSystems::Cleanup).run_if(resource_exists::<PipelineCache>),
    );
    app.insert_resource(busy);
}

fn update_busy(cache: Res<PipelineCache>, busy: Res<PipelinesBusy>) {
    busy.0.store(cache.waiting_pipelines().next().is_some(), Ordering::Relaxed);
}

//! The stage of scene files, and the tool's side of every stage.
//!
//! | folder or file | job |
//! |---|---|
//! | `mod` | what renders frames; jobs for several renderers; the knobs that affect a scene |
//! | `app` | the app of a scene file, in this process or in one of its own |
//! | `world`, `environment`, `prefilter` | a scene's geometry, lights and sky in an app |
//! | `remote` | stages in processes of their own |
//!
//! The stage itself is the plugin's: `bevy_frugal_gi::stage`.

mod app;
mod environment;
mod prefilter;
mod remote;
mod world;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use bevy::app::App;
use bevy_frugal_gi::knobs::{KnobPlugin, KnobRegistry};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;
use frugal_trace::light::Light;
use frugal_trace::metrics::Picture;
use frugal_trace::scene::CameraPose;

use crate::scene::LoadedScene;
pub(crate) use app::serve;
pub use app::{open, open_with};
pub use bevy_frugal_gi::stage::{
    Component, Output, Stage, StageError, StageOptions, adapter, software_adapter,
};
pub use frugal_trace::metrics::Radiance;
pub(crate) use remote::{Program, RemoteStage, Shot, StagedScene, guard};
pub use world::populate;

/// Renders and meters frames: a stage, or formulas in tests.
pub(crate) trait FrameRenderer {
    /// Starts a run at `pose` with `settings`: resets temporal history and warms up,
    /// so that the first frame costs no more than the others. The run's first frame follows.
    ///
    /// # Errors
    /// When the run cannot start.
    fn begin_run(&mut self, pose: &CameraPose, settings: KnobLevels) -> Result<(), StageError>;

    /// Renders the next frame, at `pose` with `settings`: its display-referred image, and its power at the
    /// target frame rate, idle + this frame's energy × frames per second. All frames are of one size.
    ///
    /// # Errors
    /// When rendering or metering fails. An unknown power is an error, never 0 W.
    fn render_frame(
        &mut self,
        pose: &CameraPose,
        settings: KnobLevels,
    ) -> Result<(Picture, Watts), StageError>;
}

/// Each worker, in a thread of its own, takes the next job when it has done its last. What a job
/// tells goes to `done`, in this thread. Once that breaks, every worker ends with what it is at, which
/// still counts.
pub(crate) fn side_by_side<W: Send, J: Sync, R: Send>(
    workers: &mut [W],
    jobs: &[J],
    job: impl Fn(&mut W, &J, &dyn Fn(R) -> ControlFlow<()>) -> ControlFlow<()> + Sync,
    mut done: impl FnMut(R) -> ControlFlow<()>,
) {
    let (next, ends) = (AtomicUsize::new(0), AtomicBool::new(false));
    // Without a buffer, so that little is rendered after the end.
    let (sender, results) = mpsc::sync_channel(0);
    std::thread::scope(|scope| {
        for worker in workers {
            let (sender, next, ends, job) = (sender.clone(), &next, &ends, &job);
            scope.spawn(move || {
                let tell = |result| match sender.send(result) {
                    Ok(()) if !ends.load(Ordering::Relaxed) => ControlFlow::Continue(()),
                    _ => ControlFlow::Break(()),
                };
                while let Some(one) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if job(worker, one, &tell).is_break() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for result in results {
            if done(result).is_break() {
                ends.store(true, Ordering::Relaxed);
            }
        }
    });
}

/// Names of the built-in knobs that can affect images of `scene`. All levels of the others look and
/// cost the same, and would only lengthen the search.
pub(crate) fn useful_knobs(scene: &LoadedScene) -> Vec<String> {
    let geometry = &scene.geometry;
    let has_light = !scene.lights.is_empty();
    let has_sun = scene.lights.iter().any(|light| matches!(light, Light::Directional { .. }));
    let has_sky = scene.has_environment_map;
    let has_emissive = geometry.materials.iter().any(|material| material.emissive != [0.0; 3]);
    let space = built_in_knobs(false);
    // From a corner, the shortest view distance may leave out the opposite one.
    let is_wide = || {
        let share = space.value(space.lowest(), "view_distance").unwrap_or(1.0);
        geometry.meshes.len() > 1
            && geometry
                .bounds()
                .is_some_and(|bounds| bounds.size().length() > share as f32 * scene.camera.far)
    };
    let useful = |name: &str| match name {
        // Only the camera moves in a scene file.
        "gi_refresh_period" => false,
        // Nor does it ask for reflections, contact shadows or fog.
        "effects" => false,
        "view_distance" => is_wide(),
        "rsm_resolution" | "shadow_map_resolution" => has_light,
        "gi_environment_samples" => has_sky,
        name if name.starts_with("gi_") => has_light || has_emissive || has_sky,
        "shadow_cascades" => has_sun,
        // Bevy's loader makes no mip levels.
        "texture_detail" => false,
        // Beside ambient and environment light it dims only indirect light without rays.
        "ambient_occlusion" => has_sky || scene.environment.sends_light(),
        _ => true,
    };
    space.knobs().iter().map(|knob| knob.name.clone()).filter(|name| useful(name)).collect()
}

/// All built-in knobs, with or without the opt-in ones.
pub(crate) fn built_in_knobs(with_opt_in: bool) -> KnobSpace {
    let mut app = App::new();
    app.add_plugins(KnobPlugin);
    let registry = app.world().resource::<KnobRegistry>();
    registry.space_with(|_| with_opt_in).expect("the built-in knobs are valid")
}

#[cfg(test)]
mod tests {
    use frugal_trace::scene::SceneGeometry;

    use super::*;
    use crate::scene::{Environment, Geometry, SceneDescription};
    use crate::subject::frame_layout;

    #[test]
    fn knobs_of_the_sky_need_a_map_and_ambient_light_is_none() {
        let description = SceneDescription::new(Geometry::Procedural(String::new()));
        let mut scene = LoadedScene::with_geometry(description, SceneGeometry::default());
        let mut useful = |environment, has_environment_map| {
            scene.description.environment = environment;
            scene.has_environment_map = has_environment_map;
            let knobs = useful_knobs(&scene);
            let has = |name: &str| knobs.iter().any(|knob| knob == name);
            let names = ["gi_environment_samples", "gi_vpl_count", "ambient_occlusion"];
            assert_eq!(frame_layout(&scene, [160, 90]).has_sky, has_environment_map);
            names.map(has)
        };
        assert_eq!(useful(Environment::None, false), [false; 3]);
        // A map that cannot be read, and ambient light, in an app.
        assert_eq!(useful(Environment::None, true), [true; 3]);
        assert_eq!(useful(Environment::Constant([80.0; 3]), false), [false, false, true]);
    }
}

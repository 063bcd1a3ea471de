//! Reads a description's geometry: Bevy's loader in an app without a renderer, and then the same
//! extraction as for any app.

use std::path::Path;
use std::time::Duration;

use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, PluginGroupBuilder, TerminalCtrlCHandlerPlugin};
use bevy::asset::{AssetPlugin, UnapprovedPathMode};
use bevy::light::GlobalAmbientLight;
use bevy::log::LogPlugin;
use bevy::render::RenderPlugin;
use bevy::render::settings::{RenderCreation, WgpuSettings};
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use bevy_frugal_gi::stage::extract::extract;
use frugal_trace::scene::SceneGeometry;

use super::check::{self, Problem};
use super::description::{Geometry, SceneDescription, glb};
use super::document::{self, Checked};
use super::spawn::{SpawnedGeometry, spawn};

/// Pause while files are read.
const YIELD: Duration = Duration::from_millis(1);

/// The bytes of a description's geometry.
///
/// # Errors
/// At the description's geometry, when its file is missing.
pub(super) fn file_bytes(description: &SceneDescription) -> Result<Vec<u8>, Problem> {
    match &description.geometry {
        Geometry::Gltf(name) => {
            let file = description.resolve(name);
            std::fs::read(&file).map_err(|error| Problem {
                field: "geometry[0]".into(),
                problem: format!("cannot read {}: {error}", file.display()),
                remedy: "give a file relative to the description".into(),
            })
        }
        Geometry::Procedural(name) => {
            Ok(glb(name).ok_or_else(|| check::no_such_scene(name))?.to_vec())
        }
    }
}

/// A description's geometry, the number of the scene in its file, and what is in the file and not
/// represented.
///
/// # Errors
/// At the description's geometry, when its file is missing, broken, or needs what Bevy's loader does
/// not read.
pub(super) fn read(description: &SceneDescription) -> Result<(SceneGeometry, Checked), Problem> {
    let (Geometry::Gltf(name) | Geometry::Procedural(name)) = &description.geometry;
    let bytes = file_bytes(description)?;
    let mut checked = document::check(&bytes).map_err(|problem| unusable(name, &problem))?;
    let file = description.resolve(name);
    let folder = file.parent().unwrap_or(Path::new(""));
    if let Some(problem) = document::short_buffer(&bytes, folder) {
        return Err(unusable(name, &problem));
    }
    let mut app = app();
    spawn(app.world_mut(), description, checked.scene, None);
    let loaded = loop {
        app.update();
        if let Some(loaded) = app.world().resource::<SpawnedGeometry>().loaded.clone() {
            break loaded;
        }
        std::thread::sleep(YIELD);
    };
    let gaps = loaded.map_err(|failure| unusable(name, &failure))?;
    // What was spawned in this update has its place in the next.
    app.update();
    let extracted = extract(app.world_mut(), None);
    checked.gaps.extend(gaps);
    checked.gaps.extend(extracted.gaps);
    if extracted.geometry.triangle_count() == 0 {
        // It may have some that Bevy shows.
        let left_out: Vec<String> = checked.gaps.iter().map(|gap| format!(" ({gap})")).collect();
        return Err(unusable(name, &format!("it has no triangles to trace{}", left_out.concat())));
    }
    Ok((extracted.geometry, checked))
}

/// Bevy's plugins without window, log and signal handler. A scene's files may be anywhere.
pub(crate) fn headless() -> PluginGroupBuilder {
    DefaultPlugins
        .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..Default::default() })
        .set(WindowPlugin {
            primary_window: None,
            exit_condition: ExitCondition::DontExit,
            ..Default::default()
        })
        .disable::<WinitPlugin>()
        .disable::<LogPlugin>()
        .disable::<TerminalCtrlCHandlerPlugin>()
}

/// An app that loads, and renders nothing.
fn app() -> App {
    let nothing = WgpuSettings { backends: None, ..Default::default() };
    let mut app = App::new();
    app.add_plugins(headless().set(RenderPlugin {
        render_creation: RenderCreation::Automatic(Box::new(nothing)),
        ..Default::default()
    }));
    app.insert_resource(GlobalAmbientLight::NONE);
    app.finish();
    app.cleanup();
    app
}

fn unusable(name: &str, problem: &str) -> Problem {
    Problem {
        field: "geometry[0]".into(),
        problem: format!("\"{name}\" cannot be used: {problem}"),
        remedy: "give a .glb or .gltf file that Bevy loads".into(),
    }
}

#[cfg(test)]
#[path = "geometry_tests.rs"]
pub(super) mod tests;

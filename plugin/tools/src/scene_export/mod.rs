//! Writes what an app shows as a scene file, which `frugal` precomputes a map for.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//! use bevy_frugal_gi_tools::SceneExportPlugin;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins, SceneExportPlugin::new("my.scene.ron")))
//!     .run();
//! ```
//!
//! Play, and close the window: `my.scene.ron` names the geometry (`my.glb` beside it), lights, lens,
//! exposure, and the cameras' ways as paths.
//!
//! Data flows from `gather` (the app's entities as plain data) to `glb` and `description` (bytes and
//! text), which know no app.

mod description;
mod gather;
mod glb;
mod tour;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use bevy::app::{AppExit, Last};
use bevy::prelude::*;
use bevy::window::ExitSystems;

use gather::SceneQuery;
use tour::Tour;

/// Writes a scene file when the app ends, and on [`ExportScene`]. Both files are replaced, each as a
/// whole or not at all. What cannot be written costs one logged error.
///
/// Exported are visible opaque and masked meshes with a [`StandardMaterial`] in their present place,
/// with base color and its texture, roughness, metallic and emission; directional, point and spot
/// lights; ambient light as a constant environment; lens and exposure of one camera, one with
/// [`FrugalGi`](bevy_frugal_gi::gi::FrugalGi) if there is any; and the ways of all cameras as paths, that one's as
/// `tour`. Left out, and counted in the log: skinned and
/// transparent meshes, other materials, and meshes that the CPU cannot read.
#[derive(Clone, Debug)]
pub struct SceneExportPlugin {
    file: PathBuf,
}

impl SceneExportPlugin {
    /// Writes to `file`, such as `my.scene.ron`; geometry goes to `my.glb` beside it.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self { file: file.into() }
    }
}

/// Writes the scene files at the end of this frame.
#[derive(Message, Clone, Copy, Debug, Default)]
pub struct ExportScene;

#[derive(Resource)]
struct Export {
    file: PathBuf,
    /// The way of each camera, in the order in which they became active.
    tours: Vec<(Entity, Tour)>,
}

impl Plugin for SceneExportPlugin {
    fn build(&self, app: &mut App) {
        app.add_message::<ExportScene>()
            // The frame in which the last window closes is the last one: after what ends the app.
            .insert_resource(Export { file: self.file.clone(), tours: Vec::new() })
            .add_systems(Last, (follow, export).chain().after(ExitSystems));
    }
}

/// Greatest number of cameras whose ways are exported.
const MAX_CAMERAS: usize = 16;

/// Records the cameras' ways.
fn follow(mut export: ResMut<Export>, shown: SceneQuery, time: Option<Res<Time<Real>>>) {
    let Some(time) = time else {
        warn_once!(
            "SceneExportPlugin exports no ways of cameras: this app has no clock, add TimePlugin"
        );
        return;
    };
    let tours = &mut export.tours;
    for (camera, at) in shown.active_cameras() {
        let known = tours.iter().position(|(known, _)| *known == camera);
        let index = match known {
            Some(index) => index,
            None if tours.len() < MAX_CAMERAS => {
                tours.push((camera, Tour::default()));
                tours.len() - 1
            }
            None => continue,
        };
        tours[index].1.push(time.elapsed_secs_f64(), at.translation(), *at.forward());
    }
}

fn export(
    mut asked: MessageReader<ExportScene>,
    mut ends: MessageReader<AppExit>,
    export: Res<Export>,
    shown: SceneQuery,
) {
    if asked.read().count() + ends.read().count() == 0 {
        return;
    }
    match write(&export, &shown) {
        Ok(summary) => info!("{}: {summary}", export.file.display()),
        Err(error) => error!("{}: the scene is not exported: {error}", export.file.display()),
    }
}

fn write(export: &Export, shown: &SceneQuery) -> io::Result<String> {
    let geometry_file = glb_beside(&export.file);
    let (geometry, left_out) = shown.geometry();
    if geometry.instances.is_empty() {
        return Err(io::Error::other(format!("no mesh can be exported ({left_out})")));
    }
    let main = shown.main_camera();
    // The exported camera's is the path that `frugal` plays.
    let mut tours: Vec<&(Entity, Tour)> = export.tours.iter().collect();
    tours.sort_by_key(|(camera, _)| Some(*camera) != main);
    let tours: Vec<_> = tours.into_iter().map(|(_, tour)| tour.keys().to_vec()).collect();
    let name = geometry_file.file_name().unwrap_or_default().to_string_lossy();
    let scene = shown.scene(&geometry, name.into_owned(), &tours);
    let text = scene.to_ron().map_err(io::Error::other)?;
    replace(&geometry_file, &geometry.to_glb())?;
    replace(&export.file, text.as_bytes())?;
    Ok(format!(
        "{} meshes in {} places, {} lights, ways of {} cameras; left out: {left_out}",
        geometry.meshes.len(),
        geometry.instances.len(),
        scene.lights.len(),
        tours.len()
    ))
}

/// `my.glb` for `my.scene.ron`.
fn glb_beside(file: &Path) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.split_once('.').map_or(&*name, |(stem, _)| stem);
    file.with_file_name(format!("{stem}.glb"))
}

/// Writes a file as a whole or not at all.
fn replace(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(".tmp");
    let temporary = file.with_file_name(name);
    let written = File::create(&temporary)
        .and_then(|mut file| {
            file.write_all(bytes)?;
            file.sync_all()
        })
        .and_then(|()| fs::rename(&temporary, file));
    if written.is_err() {
        // Nothing half-written is left; the first error counts.
        let _ = fs::remove_file(&temporary);
    }
    written
}

#[cfg(test)]
mod tests;

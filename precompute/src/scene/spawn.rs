//! A description's geometry in an app, by Bevy's own glTF loader.

use std::collections::{BTreeSet, HashSet};
use std::path::Path;

use bevy::app::PostUpdate;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::asset::{AssetId, AssetPath, AssetServer, Assets, Handle, LoadState};
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::Children;
use bevy::ecs::observer::On;
use bevy::ecs::resource::Resource;
use bevy::ecs::schedule::Schedules;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::ecs::world::World;
use bevy::gltf::{GltfAssetLabel, GltfLoaderSettings};
use bevy::image::Image;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::world_serialization::{WorldAsset, WorldAssetRoot, WorldInstanceReady};
use bevy_frugal_gi::stage::extract::gap_line;

use super::description::{Geometry, SceneDescription, glb};

/// Folder of the scenes that come with the tool, among the app's embedded assets.
const EMBEDDED_FOLDER: &str = "frugal_scenes";

/// How the geometry of this world's scene was loaded.
#[derive(Resource, Clone, Debug)]
pub(crate) struct SpawnedGeometry {
    root: Entity,
    scene: Handle<WorldAsset>,
    exposure: Option<f32>,
    is_spawned: bool,
    /// `None` while it loads. Then the images that are missing, as sentences, or why the file cannot
    /// be used.
    pub(crate) loaded: Option<Result<Vec<String>, String>>,
}

/// Spawns a description's geometry, which its file then loads into; [`SpawnedGeometry`] says when.
/// The world must be that of an app with Bevy's default plugins, whose assets may be anywhere for a
/// file outside the app's own folder: `AssetPlugin::unapproved_path_mode`.
///
/// The factor of emissive materials counts in nits in a scene's file, and in the app unless there is an
/// `exposure`, which scales it: Bevy 0.19's G-buffer does not store the exposure weight of emission.
pub(crate) fn spawn(
    world: &mut World,
    description: &SceneDescription,
    scene: usize,
    exposure: Option<f32>,
) {
    let path = match &description.geometry {
        Geometry::Gltf(name) => {
            let file = description.resolve(name);
            AssetPath::from_path_buf(std::path::absolute(&file).unwrap_or(file))
        }
        Geometry::Procedural(name) => {
            let path = Path::new(EMBEDDED_FOLDER).join(format!("{name}.glb"));
            let bytes = glb(name).unwrap_or_default();
            if let Some(embedded) = world.get_resource::<EmbeddedAssetRegistry>() {
                embedded.insert_asset(path.clone(), &path, bytes);
            }
            AssetPath::from_path_buf(path).with_source("embedded")
        }
    };
    let path = path.with_label(GltfAssetLabel::Scene(scene).to_string());
    let settings = |settings: &mut GltfLoaderSettings| {
        // A scene file names its own; and validity has been checked with more leniency.
        (settings.load_cameras, settings.load_lights) = (false, false);
        (settings.load_animations, settings.validate) = (false, false);
    };
    let scene: Handle<WorldAsset> = world
        .resource::<AssetServer>()
        .load_builder()
        .with_settings(settings)
        .override_unapproved()
        .load(path);
    let is_ready = |_: On<WorldInstanceReady>, mut spawned: ResMut<SpawnedGeometry>| {
        spawned.is_spawned = true;
    };
    let root = world.spawn(WorldAssetRoot(scene.clone())).observe(is_ready).id();
    let spawned = SpawnedGeometry { root, scene, exposure, is_spawned: false, loaded: None };
    world.insert_resource(spawned);
    if let Some(mut schedules) = world.get_resource_mut::<Schedules>() {
        schedules.add_systems(PostUpdate, finish);
    }
}

/// Finishes geometry whose file and images are loaded.
fn finish(
    mut spawned: ResMut<SpawnedGeometry>,
    server: Res<AssetServer>,
    children: Query<&Children>,
    drawn: Query<&MeshMaterial3d<StandardMaterial>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    if spawned.loaded.is_some() {
        return;
    }
    if let LoadState::Failed(error) = server.load_state(&spawned.scene) {
        spawned.loaded = Some(Err(error.to_string()));
    } else if spawned.scene.path().is_none() {
        let message = "the app's `AssetPlugin::unapproved_path_mode` forbids its folder";
        spawned.loaded = Some(Err(message.to_owned()));
    } else if spawned.is_spawned {
        let parts = children.iter_descendants(spawned.root);
        let used: HashSet<_> =
            parts.filter_map(|part| Some(drawn.get(part).ok()?.0.id())).collect();
        let gaps = finish_materials(&used, &server, &mut materials, spawned.exposure);
        spawned.loaded = gaps.map(Ok);
    }
}

/// Leaves out images that are missing, without which Bevy draws nothing, and sets the unit of
/// emission. Returns the images that are missing, as sentences; `None`, and does nothing, while one
/// loads.
fn finish_materials(
    used: &HashSet<AssetId<StandardMaterial>>,
    server: &AssetServer,
    materials: &mut Assets<StandardMaterial>,
    exposure: Option<f32>,
) -> Option<Vec<String>> {
    let is_loading = |id: &AssetId<StandardMaterial>| {
        materials.get(*id).is_none_or(|material| {
            let mut material = material.clone();
            let mut images = slots(&mut material).into_iter().flatten();
            images.any(|image| matches!(server.get_load_state(&*image), Some(LoadState::Loading)))
        })
    };
    if used.iter().any(is_loading) {
        return None;
    }
    let mut missing = BTreeSet::new();
    for id in used {
        let Some(mut material) = materials.get_mut(*id) else { continue };
        for slot in slots(&mut material) {
            if let Some(LoadState::Failed(_)) =
                slot.as_ref().and_then(|image| server.get_load_state(image))
            {
                let path = slot.take().and_then(|image| Some(image.path()?.to_string()));
                missing.insert(path.unwrap_or_default());
            }
        }
        match exposure {
            None => material.emissive_exposure_weight = 1.0,
            Some(exposure) => {
                let emissive = &mut material.emissive;
                for channel in [&mut emissive.red, &mut emissive.green, &mut emissive.blue] {
                    *channel *= exposure;
                }
            }
        }
    }
    let gap = gap_line("images that are missing, or cannot be read, and are white", &missing);
    Some(gap.into_iter().collect())
}

fn slots(material: &mut StandardMaterial) -> [&mut Option<Handle<Image>>; 5] {
    [
        &mut material.base_color_texture,
        &mut material.metallic_roughness_texture,
        &mut material.emissive_texture,
        &mut material.normal_map_texture,
        &mut material.occlusion_texture,
    ]
}

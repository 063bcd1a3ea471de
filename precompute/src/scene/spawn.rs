//! A description's geometry in an app, by Bevy's own glTF loader.

use std::path::Path;

use bevy::app::PostUpdate;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::asset::{AssetPath, AssetServer, Assets, Handle, LoadState};
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::Children;
use bevy::ecs::observer::On;
use bevy::ecs::resource::Resource;
use bevy::ecs::schedule::Schedules;
use bevy::ecs::system::ResMut;
use bevy::ecs::world::World;
use bevy::gltf::{GltfAssetLabel, GltfLoaderSettings};
use bevy::image::Image;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::world_serialization::{WorldAsset, WorldAssetRoot, WorldInstanceReady};

use super::built_in;
use super::description::{Geometry, SceneDescription};

/// Folder of the scenes that come with the tool, among the app's embedded assets.
const EMBEDDED_FOLDER: &str = "frugal_scenes";

/// The unit of emissive materials, whose factor counts in nits in a scene's file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Emission {
    /// Nits.
    Nits,
    /// The renderer's, which are nits × this exposure: Bevy 0.19's G-buffer does not store the
    /// exposure weight of emission.
    Exposed(f32),
}

/// How the geometry of this world's scene was loaded.
#[derive(Resource, Clone, Debug)]
pub(crate) struct SpawnedGeometry {
    root: Entity,
    scene: Handle<WorldAsset>,
    emission: Emission,
    is_spawned: bool,
    /// It is there, or has failed.
    pub(crate) is_complete: bool,
    /// Why the file cannot be used.
    pub(crate) failure: Option<String>,
    /// Images that are missing, as sentences.
    pub(crate) gaps: Vec<String>,
}

/// Spawns a description's geometry, which its file then loads into; [`SpawnedGeometry`] says when.
/// The world must be that of an app with Bevy's default plugins, whose assets may be anywhere for a
/// file outside the app's own folder: `AssetPlugin::unapproved_path_mode`.
pub(crate) fn spawn(
    world: &mut World,
    description: &SceneDescription,
    scene: usize,
    emission: Emission,
) {
    let path = match &description.geometry {
        Geometry::Gltf(name) => {
            let file = description.resolve(name);
            AssetPath::from_path_buf(std::path::absolute(&file).unwrap_or(file))
        }
        Geometry::Procedural(name) => {
            let path = Path::new(EMBEDDED_FOLDER).join(format!("{name}.glb"));
            let bytes = built_in::glb(name).unwrap_or_default();
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
    let spawned = SpawnedGeometry {
        root,
        scene,
        emission,
        is_spawned: false,
        is_complete: false,
        failure: None,
        gaps: Vec::new(),
    };
    world.insert_resource(spawned);
    if let Some(mut schedules) = world.get_resource_mut::<Schedules>() {
        schedules.add_systems(PostUpdate, finish);
    }
}

/// Finishes geometry whose file and images are loaded.
fn finish(world: &mut World) {
    let mut spawned = world.resource::<SpawnedGeometry>().clone();
    if spawned.is_complete {
        return;
    }
    let state = world.resource::<AssetServer>().load_state(&spawned.scene);
    if let LoadState::Failed(error) = state {
        spawned.failure = Some(error.to_string());
    } else if spawned.scene.path().is_none() {
        let message = "the app's `AssetPlugin::unapproved_path_mode` forbids its folder";
        spawned.failure = Some(message.to_owned());
    } else if spawned.is_spawned
        && let Some(gaps) = finish_materials(world, spawned.root, spawned.emission)
    {
        spawned.gaps = gaps;
    } else {
        return;
    }
    spawned.is_complete = true;
    world.insert_resource(spawned);
}

/// Leaves out images that are missing, without which Bevy draws nothing, and sets the unit of
/// emission. Returns the images that are missing, as sentences; `None`, and does nothing, while one
/// loads.
fn finish_materials(world: &mut World, root: Entity, emission: Emission) -> Option<Vec<String>> {
    let mut pending = vec![root];
    let mut handles: Vec<Handle<StandardMaterial>> = Vec::new();
    while let Some(entity) = pending.pop() {
        pending.extend(world.get::<Children>(entity).iter().flat_map(|children| children.iter()));
        if let Some(material) = world.get::<MeshMaterial3d<StandardMaterial>>(entity)
            && !handles.contains(&material.0)
        {
            handles.push(material.0.clone());
        }
    }
    let server = world.resource::<AssetServer>().clone();
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let is_loading = |handle: &Handle<StandardMaterial>| {
        materials.get(handle).is_none_or(|material| {
            let mut material = material.clone();
            let mut images = slots(&mut material).into_iter().flatten();
            images.any(|image| matches!(server.get_load_state(&*image), Some(LoadState::Loading)))
        })
    };
    if handles.iter().any(is_loading) {
        return None;
    }
    let mut missing = Vec::new();
    for handle in &handles {
        let Some(mut material) = materials.get_mut(handle) else { continue };
        for slot in slots(&mut material) {
            if let Some(LoadState::Failed(_)) =
                slot.as_ref().and_then(|image| server.get_load_state(image))
            {
                let path = slot.take().and_then(|image| Some(image.path()?.to_string()));
                missing.push(format!(
                    "an image is missing and read as white: {}",
                    path.unwrap_or_default()
                ));
            }
        }
        match emission {
            Emission::Nits => material.emissive_exposure_weight = 1.0,
            Emission::Exposed(exposure) => {
                let emissive = &mut material.emissive;
                for channel in [&mut emissive.red, &mut emissive.green, &mut emissive.blue] {
                    *channel *= exposure;
                }
            }
        }
    }
    missing.sort();
    missing.dedup();
    Some(missing)
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

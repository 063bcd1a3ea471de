//! The assets that surfaces are made of.

use bevy::asset::Assets;
use bevy::ecs::change_detection::Res;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;

/// For systems that read surfaces in the main world.
#[derive(SystemParam)]
pub(in crate::gi) struct SurfaceAssets<'w> {
    pub meshes: Res<'w, Assets<Mesh>>,
    /// `None` in an app without images, or without Bevy's materials.
    pub images: Option<Res<'w, Assets<Image>>>,
    pub materials: Option<Res<'w, Assets<StandardMaterial>>>,
}

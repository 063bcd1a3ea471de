//! The assets that surfaces are made of.

use bevy::asset::Assets;
use bevy::ecs::change_detection::Res;
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;

use super::copies::{GiTextureCopies, Textures};

/// For systems that read surfaces in the main world.
#[derive(SystemParam)]
pub(in crate::gi) struct SurfaceAssets<'w> {
    pub meshes: Res<'w, Assets<Mesh>>,
    /// `None` in an app without images.
    images: Option<Res<'w, Assets<Image>>>,
    /// `None` in an app without Bevy's materials.
    pub materials: Option<Res<'w, Assets<StandardMaterial>>>,
    copies: Res<'w, GiTextureCopies>,
}

impl SurfaceAssets<'_> {
    pub(crate) fn textures(&self) -> Textures<'_> {
        Textures { images: self.images.as_deref(), copies: &self.copies }
    }
}

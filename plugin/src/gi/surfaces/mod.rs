//! Surfaces as the main world can read them: triangles, textures and alpha masks of meshes.
//!
//! For surfaces outside every rendered view that occlude light, emit it or reflect it again.

mod cache;
mod changes;
mod copies;
mod cutout;
mod mesh;
mod points;
mod reflectance;
mod scan;
mod set;
mod texture;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::prelude::*;
use bevy::transform::TransformSystems;

use super::schedule::SceneSystems;
pub(super) use cache::{SurfaceCache, SurfaceEvents, SurfaceKey};
pub(super) use changes::MeshChanges;
#[cfg(test)]
pub(super) use changes::note as note_changes;
pub use copies::GiTextureCopies;
pub(super) use copies::SurfaceAssets;
pub(super) use cutout::{Cutout, Mask};
pub(super) use mesh::{Sides, Triangles, triangles};
pub(super) use points::{
    MAX_COORDINATE, SurfacePoint, SurfacePoints, TrianglePoint, area_matrix, is_in_range,
};
pub(super) use reflectance::{MaterialSample, Reflectance, is_deferred, occludes};
pub(super) use set::{SurfaceInstance, SurfaceMesh, SurfaceSet};
pub(super) use texture::{MeshTexture, TextureUse};

pub(super) struct SurfacesPlugin;

impl Plugin for SurfacesPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<MeshChanges>().add_systems(
            PostUpdate,
            // Need this frame's asset events, final transforms, boxes and visibility.
            changes::note
                .in_set(SceneSystems::Changes)
                .after(AssetEventSystems)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate)
                .after(VisibilitySystems::CalculateBounds),
        );
        copies::pass::embed(app);
        copies::build(app);
    }

    fn finish(&self, app: &mut App) {
        copies::pass::finish(app);
    }
}

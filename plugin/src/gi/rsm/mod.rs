//! Reflective shadow maps: what each light sees, as texels of position, normal and reflected flux.
//!
//! Options for rendering one: (1) a hidden camera with a deferred prepass; (2) an own phase in an
//! own render-world view; (3) an own phase in Bevy's shadow views. We use 1: textures, alpha masks,
//! skins, morphs and extended materials come with it, and it needs no shadow map. Its side effects
//! are kept small: the camera has no clusters, so Bevy gives it no cascades and no light lists, and
//! no main phases.

mod lights;
mod region;
mod resolve;
mod texel;
mod views;

use bevy::app::{App, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::ecs::prelude::*;
use bevy::reflect::Reflect;
use bevy::render::extract_component::ExtractComponent;

use crate::knobs::KnobSystems;

pub(super) use lights::RsmLight;
pub(super) use region::RsmCut;
pub(super) use resolve::{
    RsmPipelines, RsmStore, TEXEL_BYTES, drop_main_phases, prepare_store, resolve,
};
pub(super) use texel::{Texel, pack_normal};
pub(super) use views::MapsTouched;

/// Marks a hidden camera that renders what a light sees. Filter your own camera queries with
/// `Without<RsmView>` if they mean visible cameras.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Component, Clone, PartialEq, Hash)]
pub struct RsmView {
    /// The light.
    pub light: Entity,
    /// The GI camera whose surroundings it covers; none where the map serves all cameras.
    pub camera: Option<Entity>,
    /// Cube face of a point light, 0 to 5. Of a directional light's maps, 0 is that of the
    /// surroundings and 1 that of what is near the camera.
    pub face: u8,
}

/// In the main world.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum RsmSystems {
    /// Maps' cameras come, move and go.
    Maintain,
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<region::SceneBox>().init_resource::<MapsTouched>().add_systems(
        PostUpdate,
        // Need to come before cameras are updated: sizes, projections and transforms written here
        // are picked up in the same frame. Need the knobs' levels, for the same reason.
        (region::update_scene_box, views::maintain)
            .chain()
            .in_set(RsmSystems::Maintain)
            .after(KnobSystems::Apply)
            .before(CameraUpdateSystems),
    );
}

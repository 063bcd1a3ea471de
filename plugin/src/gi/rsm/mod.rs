//! Reflective shadow maps: the surfaces that each light illuminates, as texels of position, normal
//! and reflected flux.
//!
//! Options for rendering one: (1) a hidden camera with a deferred prepass; (2) an own phase in an
//! own render-world view; (3) an own phase in Bevy's shadow views. We use 1: it supports textures,
//! alpha masks, skins, morphs and extended materials, and needs no shadow map. Its side effects are
//! small: the camera has no clusters, so Bevy gives it no cascades and no light lists, and we
//! remove its main phases.

mod air;
mod capacity;
mod drawn;
mod extent;
mod focus;
mod lights;
mod region;
mod resolve;
mod scene_box;
mod selection;
mod slots;
mod specs;
mod views;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::embedded_asset;
use bevy::camera::visibility::{RenderLayers, VisibilitySystems};
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::reflect::Reflect;
use bevy::render::extract_component::{
    ExtractComponent, ExtractComponentPlugin, UniformComponentPlugin,
};
use bevy::render::{GpuResourceAppExt, Render, RenderSystems};

use super::schedule::{GiSystems, PrepareSystems, SceneSystems, supported_render_app};
use super::texels::CascadeCut;
pub(super) use extent::{Around, MapExtent};
pub(super) use lights::RsmLight;
pub(super) use resolve::resolve;
pub(super) use views::MapDelta;

/// Marks a hidden camera that renders a light's reflective shadow map. Filter camera queries by
/// `Without<RsmView>` where they mean visible cameras.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Component, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub struct RsmView {
    /// The light.
    pub light: Entity,
    /// The GI camera whose surroundings it covers; `None` where the map serves all cameras.
    pub camera: Option<Entity>,
    /// Cube face of a point light, 0 to 5. Cascade of a directional light: 0 is the far one and 1
    /// the near one.
    pub face: u8,
}

/// Render layers of a map's light: the map draws meshes, and serves cameras, that share one of them.
#[derive(Component, ExtractComponent, Clone, Debug, Default, PartialEq)]
pub(super) struct MapLayers(pub RenderLayers);

/// How up to date a map's texels are.
#[derive(Component, ExtractComponent, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MapAge {
    /// Frames for which the scene has differed from its texels; 0 where it does not.
    pub stale: u32,
    /// Whether its range of the store holds its texels.
    pub filled: bool,
    /// Whether texels of other maps are wrong until it is rendered.
    pub urgent: bool,
}

/// What a map's light matters to GI cameras, and how much of it they get.
#[derive(Component, ExtractComponent, Clone, Copy, Debug, PartialEq)]
pub(super) struct MapWeight {
    /// Above 0; those of other maps compare with it.
    pub importance: f32,
    /// Share of its light, 0 to 1: below 1 while it fades in or out.
    pub share: f32,
}

impl Default for MapWeight {
    fn default() -> Self {
        Self { importance: 0.0, share: 1.0 }
    }
}

pub(super) struct RsmPlugin;

impl Plugin for RsmPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "resolve.wgsl");
        app.register_type::<RsmView>()
            .init_resource::<scene_box::SceneBox>()
            .init_resource::<MapDelta>()
            .init_resource::<selection::LightSelection>()
            .init_resource::<slots::MapSlots>()
            .add_plugins((
                ExtractComponentPlugin::<RsmView>::default(),
                ExtractComponentPlugin::<RsmLight>::default(),
                ExtractComponentPlugin::<CascadeCut>::default(),
                ExtractComponentPlugin::<MapLayers>::default(),
                ExtractComponentPlugin::<MapAge>::default(),
                ExtractComponentPlugin::<MapWeight>::default(),
                UniformComponentPlugin::<RsmLight>::default(),
            ))
            .add_systems(
                PostUpdate,
                (
                    (scene_box::update_scene_box.run_if(scene_box::is_touched), views::maintain)
                        .chain()
                        .in_set(SceneSystems::Maps),
                    drawn::list
                        .in_set(VisibilitySystems::CheckVisibility)
                        .in_set(SceneSystems::Drawn)
                        .run_if(drawn::is_needed),
                ),
            );
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<resolve::RsmKernel>()
            .add_systems(
                Render,
                (
                    resolve::drop_main_phases.in_set(RenderSystems::CreateViews),
                    resolve::reserve.in_set(PrepareSystems::Reserve),
                ),
            )
            .add_systems(Core3d, resolve.in_set(GiSystems::Resolve));
    }
}

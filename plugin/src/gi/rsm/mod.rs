//! Reflective shadow maps: the surfaces that each light illuminates, as texels of position, normal
//! and reflected flux.
//!
//! Hidden cameras with a deferred prepass render them, since that supports textures, alpha masks,
//! skins, morphs and extended materials. They have no clusters, so Bevy gives them no cascades and
//! no light lists, and their main phases are removed.
//!
//! A map is out of date when its light, or anything that it can show, changes. It is rendered as
//! soon as the app's limit of maps in a frame allows. After a mesh, a texture or a material is
//! added, all maps are rendered for a few more frames, since Bevy may not draw it in its first.
//!
//! | file | world | job |
//! |---|---|---|
//! | `lights`, `air` | main | the lights that bounce, and their attenuation by the atmosphere |
//! | `focus`, `region` | none | the part of the scene that maps of directional lights cover |
//! | `selection` | main | which lights have maps |
//! | `specs` | main | the maps that should exist |
//! | `map` | both | a map's data, and where its texels lie |
//! | `views` | main | keeps a hidden camera for each map |
//! | `changes`, `extent` | main | where the scene changed, where meshes are, the box around all |
//! | `refresh` | main | which maps are rendered in a frame |
//! | `drawn` | main | which meshes a map draws |
//! | `resolve` | render | turns a map's G-buffer into texels |

mod air;
mod changes;
mod drawn;
mod extent;
mod focus;
mod lights;
mod map;
mod refresh;
mod region;
mod resolve;
mod selection;
mod specs;
mod views;

use bevy::app::{App, PostUpdate, SubApp};
use bevy::asset::embedded_asset;
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::extract_component::{ExtractComponentPlugin, UniformComponentPlugin};
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderSystems};

use super::schedule::{GiSystems, SceneSystems};
pub(super) use lights::RsmLight;
pub(super) use map::LightMap;
pub use map::RsmView;
pub(super) use resolve::{reserve, resolve};

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "resolve.wgsl");
    app.register_type::<RsmView>()
        .init_resource::<extent::SceneBox>()
        .init_resource::<views::MapsReweighted>()
        .init_resource::<selection::LightSelection>()
        .init_resource::<map::MapSlots>()
        .add_plugins((
            ExtractComponentPlugin::<LightMap>::default(),
            UniformComponentPlugin::<RsmLight>::default(),
        ))
        .add_systems(
            PostUpdate,
            (
                (extent::update_scene_box.run_if(extent::is_touched), views::maintain)
                    .chain()
                    .in_set(SceneSystems::Maps),
                refresh::decide.in_set(SceneSystems::Refresh),
                drawn::list
                    .in_set(VisibilitySystems::CheckVisibility)
                    .in_set(SceneSystems::Drawn)
                    .run_if(drawn::is_needed),
            ),
        );
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<resolve::RsmKernel>()
        .add_systems(ExtractSchedule, views::end_views)
        .add_systems(Render, resolve::drop_main_phases.in_set(RenderSystems::CreateViews))
        .add_systems(Core3d, resolve.in_set(GiSystems::Resolve));
}

//! Indirect light on meshes that are not deferred: forward-rendered, transparent and transmissive ones.
//!
//! A grid of places around the camera, fixed in the world, keeps the irradiance of six directions
//! (an ambient cube: Mitchell, `McTaggart` and Green 2006, "Shading in Valve's Source Engine"). Each
//! frame lights some of the places by the camera's VPLs and its sky, with rays. Bevy shades forward
//! meshes from them as from a baked irradiance volume, so that every material that Bevy lights
//! takes part. Deferred lighting would read the volume, too: it stays black until the composite is
//! done.
//!
//! A place inside a solid sees the back of a triangle before a front. It shows the mean of its
//! neighbours outside.
//!
//! | file | world | job |
//! |---|---|---|
//! | `volume` | main | keeps a volume around each camera that draws such meshes |
//! | `view` | render | a camera's buffers, and its work in a frame |
//! | `passes` | render | pipelines and passes |
//! | `probe.wgsl` | | what is kept of a place |
//! | `light.wgsl` | | lights places |
//! | `fill.wgsl` | | writes the volume, and blackens it |
//!
//! Places that have converged trace no rays while nothing changes.

mod passes;
mod view;
mod volume;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::embedded_asset;
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::prelude::*;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderSystems};
use bevy::shader::load_shader_library;

use super::compute::drop_with;
use super::schedule::{
    GiSystems, PassSystems, PrepareSystems, SceneSystems, is_not_off, supported_render_app,
};
use super::settings::FrugalGi;
use super::view::GiView;
pub(super) use view::{ForwardView, LOOKS, PROBE_BYTES, RAYS, VolumeSettings};
pub(super) use volume::{ForwardCamera, PLACES};

pub(super) struct ForwardPlugin;

impl Plugin for ForwardPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "probe.wgsl");
        embedded_asset!(app, "light.wgsl");
        embedded_asset!(app, "fill.wgsl");
        app.init_resource::<volume::ForwardDrawn>()
            .add_observer(drop_with::<FrugalGi, ForwardCamera>)
            .add_observer(volume::despawn)
            .add_systems(
                PostUpdate,
                (
                    volume::place.in_set(SceneSystems::Maps),
                    volume::show_to_its_camera
                        .after(VisibilitySystems::CheckVisibility)
                        .run_if(is_not_off),
                ),
            );
    }

    fn finish(&self, app: &mut App) {
        let drawn = app.world().resource::<volume::ForwardDrawn>().clone();
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .insert_resource(drawn)
            .init_gpu_resource::<passes::ForwardKernels>()
            .add_observer(drop_with::<GiView, ForwardView>)
            .add_systems(ExtractSchedule, volume::extract)
            .add_systems(
                Render,
                (
                    volume::note_drawn.in_set(RenderSystems::PhaseSort),
                    passes::prepare_pipelines.in_set(PrepareSystems::GatherPipelines),
                    view::prepare.in_set(PrepareSystems::Forward),
                ),
            )
            .add_systems(
                Core3d,
                (
                    passes::light.in_set(PassSystems::Forward),
                    passes::fill
                        .in_set(Core3dSystems::MainPass)
                        .after(GiSystems::Composite)
                        .before(main_opaque_pass_3d),
                ),
            );
    }
}

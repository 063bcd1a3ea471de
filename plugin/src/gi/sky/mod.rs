//! The sky as a source: a camera's environment map, drawn in proportion to what its surfaces could
//! receive, and hidden by what stands in the way.
//!
//! | pass | when | job |
//! |---|---|---|
//! | `fill.wgsl` | when the map changes | the map as parts of equal solid angle |
//! | `weigh.wgsl` | when VPLs are drawn | what some points of the picture could receive of each part, by rays |
//! | `sample.wgsl` | when VPLs are drawn | samples: directions that stand for the whole sky |
//! | `gather/gather.wgsl` | when the camera gathers | what each pixel receives of its samples |
//!
//! Samples of the sky lie beside the VPLs of bounced light and not among them: the sky is
//! everywhere as far away, so that it is drawn by direction; and from indoors most of it is hidden,
//! where a ray for sky and bounce together would find neither.

mod ambient;
mod camera;
mod pass;

use bevy::app::{App, Plugin};
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::load_shader_library;

use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
pub(super) use camera::{SET_BYTES, SKY_LIGHT_BYTES, SkyCamera, SkyInputs, SkyPlan, SkyReading};
pub(super) use pass::sample;

pub(super) struct SkyPlugin;

impl Plugin for SkyPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "sky.wgsl");
        embedded_asset!(app, "fill.wgsl");
        embedded_asset!(app, "weigh.wgsl");
        embedded_asset!(app, "sample.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<pass::SkyPipelines>()
            .init_gpu_resource::<ambient::BlackCubes>()
            .add_systems(
                Render,
                (
                    camera::prepare.in_set(PrepareSystems::Sky),
                    // Needs to know whose sky is gathered in this frame.
                    ambient::take_out_diffuse.in_set(PrepareSystems::Environment),
                ),
            )
            .add_systems(Core3d, sample.in_set(PassSystems::Sky));
    }
}

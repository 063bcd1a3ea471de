//! The sky as a light source: a camera's environment map, importance-sampled with visibility, and
//! shadowed by rays.
//!
//! | pass | when | job |
//! |---|---|---|
//! | `fill.wgsl` | when the map changes | integrates the map over strata of equal solid angle |
//! | `weigh.wgsl` | when VPLs are sampled | importance of each stratum to the visible surfaces, by rays |
//! | `sample.wgsl` | when VPLs are sampled | samples directions that represent the whole sky |
//! | `gather/gather.wgsl` | when the camera gathers | irradiance of each pixel from its samples |
//!
//! Sky samples are separate from the VPLs of bounced light. The sky is infinitely far away, so it
//! is sampled by direction. Indoors most of it is occluded; a ray shared by sky and bounce would
//! find neither.

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
pub(super) use camera::{
    SKY_LIGHT_BYTES, STEPS, STRATA, STRATA_PER_GROUP, SkyCamera, SkyInputs, SkyPlan, SkyReading,
};
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
            .init_gpu_resource::<camera::SkyKernels>()
            .init_gpu_resource::<ambient::BlackCubes>()
            .add_systems(
                Render,
                (
                    camera::prepare.in_set(PrepareSystems::Sky),
                    // After views decide on their work.
                    camera::prepare_sequences.in_set(PrepareSystems::Gather),
                    // Reads whose sky is gathered in this frame.
                    ambient::take_out_diffuse.in_set(PrepareSystems::Environment),
                ),
            )
            .add_systems(Core3d, sample.in_set(PassSystems::Sky));
    }
}

//! The cheap end: indirect light on surfaces, kept in the world from frame to frame, in place of the
//! gather and its filters.
//!
//! A hash table holds square cells of surface, whose size grows with the distance at which they are
//! first seen. In a frame, light is sampled at one pixel of each tile of the image, and added to that
//! pixel's cell and to coarser cells around it. Pixels show the mean of their cells, interpolated; few
//! samples are completed by those of coarser cells. Cells with enough samples take no more, and light
//! that is out of date fades.
//!
//! | file | job |
//! |---|---|
//! | `grid.wgsl` | from a point of a surface to cells |
//! | `table.wgsl` | the table: keys and cells |
//! | `record.wgsl` | what is sampled in a tile |
//! | `sight.wgsl` | what cells see of each other |
//! | `age.wgsl` | lets light fade that is out of date; drops cells |
//! | `place.wgsl` | chooses pixels and decides what is sampled there |
//! | `light.wgsl` | lights them, as the gather does pixels |
//! | `store.wgsl` | adds that to cells |
//! | `resolve.wgsl` | irradiance of low-resolution pixels |
//! | `view` | a camera's buffers |
//! | `passes` | pipelines, and the passes in their order |
//!
//! What the table holds does not depend on the order in which the GPU's threads run: light is added as
//! whole numbers, and decisions read what the frame before left.

mod passes;
mod view;

use bevy::app::{App, Plugin};
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::load_shader_library;

use super::compute::drop_with;
use super::schedule::{PassSystems, PrepareSystems, supported_render_app};
use super::view::GiView;
pub(super) use passes::resolve;
pub(super) use view::{CELL_BYTES, CacheSettings, CacheView, samples};

pub(super) struct CachePlugin;

impl Plugin for CachePlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "grid.wgsl");
        load_shader_library!(app, "table.wgsl");
        load_shader_library!(app, "record.wgsl");
        load_shader_library!(app, "sight.wgsl");
        embedded_asset!(app, "age.wgsl");
        embedded_asset!(app, "place.wgsl");
        embedded_asset!(app, "light.wgsl");
        embedded_asset!(app, "store.wgsl");
        embedded_asset!(app, "resolve.wgsl");
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<passes::CacheKernels>()
            .add_observer(drop_with::<GiView, CacheView>)
            .add_systems(
                Render,
                (
                    passes::prepare_pipelines.in_set(PrepareSystems::GatherPipelines),
                    view::prepare.in_set(PrepareSystems::Cache),
                ),
            )
            .add_systems(Core3d, resolve.in_set(PassSystems::Cache));
    }
}

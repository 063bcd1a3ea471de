//! The cheap alternative to the gather and its filters: keeps indirect light on surfaces, in the
//! world, from frame to frame.
//!
//! A hash table holds square cells of surface; the farther away a cell is first seen, the larger it
//! is. Each frame samples light at one pixel of each tile of the image, and adds it to that pixel's
//! cell and to coarser cells around it. A pixel shows the interpolated mean of its cells; coarser
//! ones complete cells of few samples. Cells with enough samples take no more. Outdated light
//! fades.
//!
//! | file | job |
//! |---|---|
//! | `grid.wgsl` | finds the cells of a point of a surface |
//! | `table.wgsl` | the table: keys and cells |
//! | `record.wgsl` | the format of what is sampled in a tile |
//! | `sight.wgsl` | visibility between cells |
//! | `age.wgsl` | fades outdated light; drops cells |
//! | `place.wgsl` | chooses pixels and decides what is sampled there |
//! | `light.wgsl` | lights the chosen pixels, as the gather does |
//! | `store.wgsl` | adds their light to cells |
//! | `resolve.wgsl` | irradiance of low-resolution pixels |
//! | `view` | a camera's buffers |
//! | `passes` | pipelines, and the passes in their order |
//!
//! The order of the GPU's threads does not matter: light is added as integers, and decisions read
//! the state of the frame before.

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

//! Visibility between surfaces and virtual point lights: rays in compute shaders over a hierarchy
//! of the scene's triangles.
//!
//! | file | world | job |
//! |---|---|---|
//! | `bvh` | none | a mesh's triangles as a tree that a GPU walks without a stack |
//! | `micromap` | none | which parts of a triangle an alpha mask leaves |
//! | `occluders` | main | keeps a tree for every mesh that hides light, and the list of where it stands |
//! | `buffers` | render | keeps both on the GPU |
//! | `trace.wgsl` | | whether anything lies between two points |
//!
//! Why rays and not imperfect shadow maps (Ritschel et al. 2008): a low-resolution depth map per
//! VPL needs all of them drawn again whenever anything moves (79 MB and 2.7 of 8.7 ms in the best
//! public implementation), leaks around every VPL, and misses what is thinner than a texel. We need
//! far fewer answers than there are VPLs: the gather asks, per pixel, only about a few VPLs drawn
//! in proportion to what they would send (see `gather/gather.wgsl`), and rays answer these exactly.

mod buffers;
mod bvh;
mod micromap;
mod occluders;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::prelude::*;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::load_shader_library;
use bevy::transform::TransformSystems;

use super::schedule::{PrepareSystems, SceneSystems, supported_render_app};
pub(super) use buffers::OccluderBuffers;
pub use occluders::GiOccluders;

/// Bytes of the structs of `trace.wgsl`. A test holds them against the shader.
pub(super) const STRUCT_BYTES: [(&str, u64); 3] = [
    ("Node", size_of::<bvh::Node>() as u64),
    ("Instance", size_of::<occluders::Instance>() as u64),
    ("Triangle", size_of::<bvh::TriangleWords>() as u64),
];

pub(super) struct TracePlugin;

impl Plugin for TracePlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "trace.wgsl");
        app.init_resource::<GiOccluders>()
            .init_resource::<occluders::MeshTrees>()
            .add_plugins(ExtractResourcePlugin::<GiOccluders>::default())
            .add_systems(
                PostUpdate,
                // Needs to know where everything is.
                occluders::update
                    .in_set(SceneSystems::Surfaces)
                    .after(TransformSystems::Propagate)
                    .after(VisibilitySystems::VisibilityPropagate),
            );
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<OccluderBuffers>()
            .add_systems(Render, buffers::prepare.in_set(PrepareSystems::Trace));
    }
}

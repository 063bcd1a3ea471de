//! Visibility between surfaces and virtual point lights: rays in compute shaders over a bounding
//! volume hierarchy of the scene's triangles.
//!
//! | file | world | job |
//! |---|---|---|
//! | `bvh` | none | binary hierarchies for stackless traversal |
//! | `wide` | none | hierarchies of four children a node, with quantised boxes |
//! | `mesh` | none | a mesh's triangles in a wide hierarchy, their micromaps, and an instance of it |
//! | `trees` | main | a hierarchy for every occluding mesh, built once |
//! | `skin` | main | skinned meshes as rigid pieces, one for each joint |
//! | `occluders` | main | which meshes occlude, and where they are |
//! | `geometry` | main | all hierarchies in one array |
//! | `top` | main | the hierarchy over instances, edited as meshes come, move and go |
//! | `mirror` | none | arrays that track what the GPU's copy lacks |
//! | `buffers` | render | the GPU's copies |
//! | `trace.wgsl` | | occlusion between two points |
//!
//! Rays, not imperfect shadow maps (Ritschel et al. 2008): the gather needs only a few visibility
//! queries per pixel (see `gather/gather.wgsl`), which rays answer exactly, while a depth map per VPL
//! would be rendered whenever anything moves.

mod buffers;
mod bvh;
mod geometry;
mod mesh;
mod mirror;
mod occluders;
mod skin;
mod top;
mod trees;
mod wide;

use bevy::camera::visibility::VisibilitySystems;
use bevy::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::shader::load_shader_library;

use super::schedule::SceneSystems;
pub(super) use buffers::{OccluderBuffers, prepare};
pub use occluders::GiOccluders;
pub(super) use wide::MAX_LEVELS;

/// Bytes of the structs of `trace.wgsl`. A test compares them with the shader.
pub(super) const STRUCT_BYTES: [(&str, u64); 4] = [
    ("Node", size_of::<bvh::Node>() as u64),
    ("WideNode", size_of::<wide::WideNode>() as u64),
    ("Instance", size_of::<mesh::Instance>() as u64),
    ("Triangle", size_of::<mesh::TriangleWords>() as u64),
];

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "trace.wgsl");
    app.init_resource::<GiOccluders>()
        .init_resource::<occluders::OccluderScene>()
        .add_plugins(ExtractResourcePlugin::<GiOccluders>::default())
        .add_systems(
            PostUpdate,
            // Reads final transforms and visibility.
            occluders::update
                .in_set(SceneSystems::Surfaces)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate),
        );
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<OccluderBuffers>()
        .add_systems(ExtractSchedule, buffers::extract);
}

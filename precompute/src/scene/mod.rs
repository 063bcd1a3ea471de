//! What is rendered: a scene's description file, its geometry, and where its cameras go. Plain
//! Rust, no renderer.
//!
//! | module | job |
//! |---|---|
//! | [`description`] | what a `*.scene.ron` file says |
//! | [`mod@load`] | reads and checks such a file; errors name file, line, column, field and remedy |
//! | [`path`] | moves a camera along a path's keys |
//! | [`mesh`], [`builder`], [`texture`] | renderer-free geometry, and how to make it by code |
//! | [`gltf`] | geometry out of a `.glb` or `.gltf` file |
//! | [`procedural`] | geometry that we make by code |
//! | [`sky`] | a latitude-longitude image of the surroundings |
//! | [`rays`] | ray queries: what a camera sees, and whether it is inside a solid |
pub mod bounds;
pub mod builder;
mod check;
pub mod description;
mod fingerprint;
pub mod gltf;
mod gltf_buffers;
pub mod load;
mod locate;
pub mod mesh;
pub mod path;
pub mod procedural;
pub mod rays;
pub mod sky;
pub mod texture;

pub use bounds::Bounds;
pub use description::{Camera, Environment, Geometry, Light, SceneDescription};
pub use load::{SceneError, load};
pub use mesh::{AlphaMode, SceneGeometry, SceneMaterial, SceneMesh, Triangle};
pub use path::{CameraKey, CameraPath, CameraPose};
pub use rays::{Hit, RayScene, Side};
pub use sky::SkyMap;
pub use texture::SceneTexture;

//! Scenes: description file, geometry, and camera paths. Plain Rust, without the renderer.
//!
//! | module | job |
//! |---|---|
//! | [`description`] | contents of a `*.scene.ron` file |
//! | [`mod@load`] | reads and checks such a file; errors name file, line, column, field and remedy |
//! | [`path`] | camera paths between keys |
//! | [`mesh`], [`builder`], [`texture`] | renderer-free geometry, and its construction in code |
//! | [`gltf`] | geometry from a `.glb` or `.gltf` file |
//! | [`procedural`] | procedural geometry |
//! | [`sky`] | latitude-longitude environment maps |
//! | [`rays`] | ray queries: visibility from cameras, inside tests |
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

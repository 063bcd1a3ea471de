//! Scenes: description file, geometry, and camera paths. Plain Rust, without the renderer.
//!
//! | module | job |
//! |---|---|
//! | `description` | contents of a `*.scene.ron` file |
//! | `load` | reads and checks such a file; errors name file, line, column, field and remedy |
//! | `path` | camera paths between keys |
//! | `mesh`, `builder`, `texture` | renderer-free geometry, and its construction in code |
//! | `gltf` | geometry from a `.glb` or `.gltf` file |
//! | `procedural` | procedural geometry |
//! | `sky` | latitude-longitude environment maps |
//! | `rays` | ray queries: visibility from cameras, inside tests |
pub(crate) mod bounds;
pub(crate) mod builder;
mod check;
pub(crate) mod description;
mod fingerprint;
pub(crate) mod gltf;
mod gltf_buffers;
pub(crate) mod load;
mod locate;
pub(crate) mod mesh;
pub(crate) mod path;
pub(crate) mod procedural;
pub(crate) mod rays;
pub(crate) mod sky;
pub(crate) mod texture;

pub(crate) use bounds::Bounds;
pub use description::{Camera, Environment, Geometry, Light, SceneDescription};
pub use load::{SceneError, load};
pub use mesh::{AlphaMode, SceneGeometry, SceneMaterial, SceneMesh, Triangle};
pub use path::{CameraKey, CameraPath, CameraPose};
pub(crate) use rays::{RayScene, Side};
pub(crate) use sky::SkyMap;
pub(crate) use texture::SceneTexture;

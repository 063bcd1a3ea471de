//! Scenes: description file, geometry from files, and camera paths. Plain Rust, without the renderer.
//!
//! | module | job |
//! |---|---|
//! | `description` | contents of a `*.scene.ron` file |
//! | `path` | camera paths between keys |
//! | `gltf`, `gltf_buffers` | geometry from a `.glb` or `.gltf` file |
//! | `built_in` | the scenes that come with the tool |
//! | `check`, `locate` | rules of a description; line and column of a field |
//! | `fingerprint` | a scene's identity |
//! | `load` | reads and checks a description; errors name file, line, column, field and remedy |
//! | `loaded` | a scene in memory, read once |
mod built_in;
mod check;
mod description;
mod fingerprint;
mod gltf;
mod gltf_buffers;
mod load;
mod loaded;
mod locate;
mod path;

pub use description::{Camera, Environment, Geometry, SceneDescription};
pub(crate) use fingerprint::fingerprint_of;
pub use load::SceneError;
pub use loaded::{LoadedScene, ReferenceError, load};
pub use path::{CameraKey, CameraPath};

//! Scenes: description file, geometry by Bevy's glTF loader, and camera paths. Nothing here renders.
//!
//! | module | job |
//! |---|---|
//! | `description` | contents of a `*.scene.ron` file |
//! | `path` | camera paths between keys |
//! | `document` | what Bevy's loader does not read of a glTF file |
//! | `spawn` | a description's geometry in an app |
//! | `geometry` | a description's geometry as plain data |
//! | `built_in` | the scenes that come with the tool |
//! | `check`, `locate` | rules of a description; line and column of a field |
//! | `fingerprint` | a scene's identity |
//! | `load` | reads and checks a description; errors name file, line, column, field and remedy |
//! | `loaded` | a scene in memory, read once |
mod built_in;
mod check;
mod description;
mod document;
mod fingerprint;
mod geometry;
mod load;
mod loaded;
mod locate;
mod path;
mod spawn;

pub use description::{Camera, Environment, Geometry, SceneDescription};
pub(crate) use fingerprint::level_fingerprint;
pub(crate) use geometry::headless;
pub use load::SceneError;
pub use loaded::{LoadedScene, ReferenceError, load};
pub use path::{CameraKey, CameraPath};
pub(crate) use spawn::{Emission, SpawnedGeometry, spawn};

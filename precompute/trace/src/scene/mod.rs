//! A scene as triangles: what a path tracer and ray queries need of it.
//!
//! | module | job |
//! |---|---|
//! | `mesh` | geometry: meshes, materials and textures as plain data |
//! | `texture` | textures with mip chains |
//! | `sky_map` | latitude-longitude environment maps |
//! | `bounds`, `camera` | boxes; a camera's pose |
//! | `rays` | ray queries: first and any hit, visibility from cameras, inside tests |

mod bounds;
mod camera;
mod mesh;
mod rays;
#[cfg(test)]
pub(crate) mod shapes;
mod sky_map;
mod texture;

pub use bounds::{Bounds, triple};
pub use camera::CameraPose;
pub use mesh::{AlphaMode, GeometryError, SceneGeometry, SceneMaterial, SceneMesh, Triangle};
pub use rays::{Hit, RayScene, Side, sphere_directions};
pub use sky_map::{SkyError, SkyMap};
pub use texture::SceneTexture;

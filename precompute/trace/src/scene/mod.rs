//! A scene as triangles: what a path tracer and ray queries need of it.
//!
//! | module | job |
//! |---|---|
//! | `mesh` | geometry as plain data |
//! | `material` | materials |
//! | `texture` | textures as a shader reads them |
//! | `sky_map` | latitude-longitude environment maps |
//! | `bounds`, `camera` | boxes; a camera's pose |
//! | `rays` | ray queries: first and any hit, visibility from cameras, inside tests |
//! | `values` | what materials and textures are at a hit |

mod bounds;
mod camera;
mod material;
mod mesh;
mod rays;
#[cfg(test)]
pub(crate) mod shapes;
mod sky_map;
mod texture;
mod values;

pub use bounds::{Bounds, triple};
pub use camera::CameraPose;
pub use material::{AlphaMode, SceneMaterial, TextureUse};
pub use mesh::{GeometryError, SceneGeometry, SceneMesh, Triangle};
pub use rays::{Hit, RayScene, Side, sphere_directions};
pub use sky_map::{SkyError, SkyMap};
pub use texture::{Filter, SceneTexture, Texels, Wrap};

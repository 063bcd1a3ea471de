//! Surfaces as the main world can read them: triangles, textures and alpha masks of meshes.
//!
//! For surfaces outside every rendered view that occlude light, emit it or reflect it again.

mod assets;
mod cache;
mod cutout;
mod points;
mod reflectance;
mod sides;
mod texture;
mod triangles;
mod vertex_colors;

pub(super) use assets::SurfaceAssets;
pub(super) use cache::{SurfaceCache, SurfaceEvents, SurfaceKey};
pub(super) use cutout::{Cutout, Mask};
pub(super) use points::{SurfacePoint, SurfacePoints, TrianglePoint, area_matrix};
pub(super) use reflectance::{MaterialSample, Reflectance, is_deferred, occludes};
pub(super) use sides::Sides;
pub(super) use texture::{MeshTexture, TextureUse};
pub(super) use triangles::{Triangles, triangles};

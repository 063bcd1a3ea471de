//! Surfaces as the main world can read them: triangles, textures and what alpha masks leave of
//! meshes.
//!
//! For what has to be known of surfaces that no picture shows: those that hide light, that glow, or
//! that reflect it again.

mod assets;
mod cutout;
mod points;
mod reflectance;
mod sides;
mod texture;
mod triangles;
mod vertex_colors;

pub(super) use assets::SurfaceAssets;
pub(super) use cutout::{Cutout, Mask};
pub(super) use points::{SurfacePoint, SurfacePoints, TrianglePoint, area_matrix};
pub(super) use reflectance::{MaterialSample, Reflectance, is_deferred, occludes};
pub(super) use sides::Sides;
pub(super) use texture::{MeshTexture, TextureUse};
pub(super) use triangles::{Triangles, triangles};

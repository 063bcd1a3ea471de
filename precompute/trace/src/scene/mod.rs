//! A scene as triangles: what a path tracer and ray queries need of it, as plain data.
//!
//! | module | job |
//! |---|---|
//! | `texture` | textures as a shader reads them |
//! | `material` | materials, and what they and textures are at a hit |
//! | `sky_map` | latitude-longitude environment maps |
//! | `place` | boxes; a camera's pose |
//! | `rays` | ray queries: first and any hit, visibility from cameras, inside tests |

mod material;
mod place;
mod rays;
mod sky_map;
#[cfg(test)]
pub(crate) mod testing;
mod texture;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use material::{AlphaMode, SceneMaterial, TextureUse};
pub(crate) use place::extent;
pub use place::{Bounds, CameraPose, triple};
pub use rays::{Hit, RayScene, Side, sphere_directions};
pub use sky_map::{SkyError, SkyMap};
pub use texture::{Filter, SceneTexture, Texels, Wrap};

/// An indexed triangle list with one material. Front faces are counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneMesh {
    /// World positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals, one per position.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per position; or none.
    pub uvs: Vec<Vec2>,
    /// Second texture coordinates, one per position; or none.
    pub second_uvs: Vec<Vec2>,
    /// Linear RGB and alpha, one per position; multiplies the material's base colour. Or none.
    pub colors: Vec<[f32; 4]>,
    /// Three per triangle.
    pub indices: Vec<u32>,
    /// Index into [`SceneGeometry::materials`].
    pub material: usize,
}

/// One triangle in world space, counter-clockwise seen from its front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners, metres.
    pub corners: [Vec3; 3],
    /// Index of its mesh in [`SceneGeometry::meshes`].
    pub mesh: usize,
    /// Number of the triangle in its mesh.
    pub index: usize,
}

/// Why a [`SceneGeometry`] is invalid.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct GeometryError(String);

/// All geometry of a scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneGeometry {
    /// Meshes, each with one material.
    pub meshes: Vec<SceneMesh>,
    /// Materials of the meshes.
    pub materials: Vec<SceneMaterial>,
    /// Textures of the materials.
    pub textures: Vec<SceneTexture>,
}

impl SceneGeometry {
    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.indices.len() / 3).sum()
    }

    /// Bounding box of all vertices that triangles use; `None` without any.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::around(self.triangles().flat_map(|triangle| triangle.corners))
    }

    /// All triangles, mesh by mesh; those with indices out of range are skipped.
    pub fn triangles(&self) -> impl Iterator<Item = Triangle> + '_ {
        self.meshes.iter().enumerate().flat_map(|(mesh, data)| {
            data.indices.chunks_exact(3).enumerate().filter_map(move |(index, corners)| {
                let corner = |i: usize| data.positions.get(corners[i] as usize).copied();
                Some(Triangle { corners: [corner(0)?, corner(1)?, corner(2)?], mesh, index })
            })
        })
    }

    /// Checks that every index is in range and every attribute is complete.
    ///
    /// # Errors
    /// The first one found.
    pub fn validate(&self) -> Result<(), GeometryError> {
        let error = |problem: String| Err(GeometryError(problem));
        if let Some(texture) = self.textures.iter().position(|texture| !texture.is_complete()) {
            return error(format!("texture {texture} is empty or incomplete"));
        }
        for (mesh, data) in self.meshes.iter().enumerate() {
            let (positions, indices) = (data.positions.len(), data.indices.len());
            for (attribute, found, is_optional) in [
                ("normals", data.normals.len(), false),
                ("uvs", data.uvs.len(), true),
                ("second uvs", data.second_uvs.len(), true),
                ("colors", data.colors.len(), true),
            ] {
                if found != positions && !(is_optional && found == 0) {
                    return error(format!(
                        "mesh {mesh} has {positions} positions but {found} {attribute}"
                    ));
                }
            }
            if indices % 3 != 0 {
                return error(format!(
                    "mesh {mesh} has {indices} indices, which is not a multiple of three"
                ));
            }
            let greatest = data.indices.iter().max().map(|index| *index as usize);
            let textures = self.materials.get(data.material).into_iter().flat_map(|material| {
                material.textures().map(|read| ("texture", Some(read.texture), self.textures.len()))
            });
            for (what, index, count) in [
                ("vertex", greatest, positions),
                ("material", Some(data.material), self.materials.len()),
            ]
            .into_iter()
            .chain(textures)
            {
                if let Some(index) = index.filter(|index| *index >= count) {
                    return error(format!(
                        "mesh {mesh} names {what} {index}, of which there are {count}"
                    ));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle_mesh(material: usize, offset: f32) -> SceneMesh {
        SceneMesh {
            positions: vec![Vec3::X * offset, Vec3::X * (offset + 1.0), Vec3::X * offset + Vec3::Y],
            normals: vec![Vec3::Z; 3],
            uvs: vec![Vec2::ZERO; 3],
            second_uvs: Vec::new(),
            colors: vec![[0.5, 1.0, 1.0, 1.0]; 3],
            indices: vec![0, 1, 2],
            material,
        }
    }

    fn geometry() -> SceneGeometry {
        let red = SceneMaterial { base_color: [1.0, 0.0, 0.0, 1.0], ..SceneMaterial::default() };
        let green = SceneMaterial { base_color: [0.0, 0.5, 0.0, 1.0], ..SceneMaterial::default() };
        let glossy = SceneMaterial { perceptual_roughness: 0.2, ..SceneMaterial::default() };
        SceneGeometry {
            meshes: vec![
                triangle_mesh(0, 0.0),
                triangle_mesh(1, 2.0),
                triangle_mesh(2, 4.0),
                triangle_mesh(0, 6.0),
            ],
            materials: vec![red, green, glossy],
            ..SceneGeometry::default()
        }
    }

    #[test]
    fn broken_geometry_is_named() {
        let refused = |geometry: &SceneGeometry| geometry.validate().map_err(|error| error.0);
        let is = |problem: &str| Err(problem.to_owned());
        let mut broken = geometry();
        broken.meshes[1].indices[2] = 3;
        assert_eq!(refused(&broken), is("mesh 1 names vertex 3, of which there are 3"));
        assert_eq!(broken.triangles().count(), 3);
        let mut broken = geometry();
        broken.meshes[2].uvs.pop();
        broken.meshes[2].colors.clear();
        assert_eq!(refused(&broken), is("mesh 2 has 3 positions but 2 uvs"));
        let mut broken = geometry();
        broken.materials[2].emissive_texture = Some(TextureUse::plain(0));
        assert_eq!(refused(&broken), is("mesh 2 names texture 0, of which there are 0"));
        let texels = Texels::Linear(vec![[0; 4]; 3]);
        let (wrap, filter) = Default::default();
        broken.textures = vec![SceneTexture { width: 2, height: 2, texels, wrap, filter }];
        assert_eq!(refused(&broken), is("texture 0 is empty or incomplete"));
        let mut broken = geometry();
        broken.meshes[0].indices.pop();
        assert_eq!(refused(&broken), is("mesh 0 has 2 indices, which is not a multiple of three"));
    }
}

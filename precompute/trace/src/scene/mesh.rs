//! Renderer-free geometry: triangles, materials and textures as plain data.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::bounds::Bounds;
use super::texture::SceneTexture;

/// Interpretation of a material's alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Fragments with an alpha below this cutoff, in [0, 1], are discarded.
    Mask(f32),
}

/// A material, in the terms of Bevy's `StandardMaterial`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneMaterial {
    /// Linear RGB reflectance and alpha, each in [0, 1]; multiplies vertex colour and texture.
    pub base_color: [f32; 4],
    /// In [0, 1]; 1 is fully rough.
    pub perceptual_roughness: f32,
    /// In [0, 1]; 0 is a dielectric.
    pub metallic: f32,
    /// Specular intensity of a dielectric in [0, 1]; 0.5 reflects 4 % at normal incidence, 0 has no
    /// specular reflection.
    pub reflectance: f32,
    /// Emitted luminance, linear RGB, nits.
    pub emissive: [f32; 3],
    /// Interpretation of alpha.
    pub alpha: AlphaMode,
    /// Whether back faces are drawn.
    pub double_sided: bool,
    /// Index into [`SceneGeometry::textures`].
    pub base_color_texture: Option<usize>,
}

impl Default for SceneMaterial {
    /// A fully rough white dielectric.
    fn default() -> Self {
        Self {
            base_color: [1.0; 4],
            perceptual_roughness: 1.0,
            metallic: 0.0,
            reflectance: 0.5,
            emissive: [0.0; 3],
            alpha: AlphaMode::Opaque,
            double_sided: false,
            base_color_texture: None,
        }
    }
}

impl SceneMaterial {
    /// All properties but the base colour, as comparable bits: meshes with equal keys can be
    /// merged.
    fn merge_key(&self) -> [u32; 10] {
        let [red, green, blue] = self.emissive.map(f32::to_bits);
        let (mode, cutoff) = match self.alpha {
            AlphaMode::Opaque => (0, 0),
            AlphaMode::Mask(cutoff) => (1, cutoff.to_bits()),
        };
        let texture = self.base_color_texture.map_or(0, |index| index as u32 + 1);
        [
            self.perceptual_roughness.to_bits(),
            self.metallic.to_bits(),
            self.reflectance.to_bits(),
            red,
            green,
            blue,
            mode,
            cutoff,
            u32::from(self.double_sided),
            texture,
        ]
    }
}

/// An indexed triangle list with one material. Front faces are counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneMesh {
    /// World positions, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals, one per position.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one per position; textures repeat.
    pub uvs: Vec<Vec2>,
    /// Linear RGB and alpha, one per position; multiplies the material's base colour.
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
pub enum GeometryError {
    /// An attribute's length differs from the number of positions.
    #[error("mesh {mesh} has {positions} positions but {found} {attribute}")]
    AttributeLength {
        /// Index of the mesh.
        mesh: usize,
        /// The attribute.
        attribute: &'static str,
        /// Number of positions.
        positions: usize,
        /// Number of values of the attribute.
        found: usize,
    },
    /// An index is out of range.
    #[error("mesh {mesh} names {what} {index}, of which there are {count}")]
    OutOfRange {
        /// Index of the mesh.
        mesh: usize,
        /// Kind of the index.
        what: &'static str,
        /// The index.
        index: usize,
        /// Number of valid indices.
        count: usize,
    },
    /// The index count is not a multiple of three.
    #[error("mesh {mesh} has {count} indices, which is not a multiple of three")]
    PartialTriangle {
        /// Index of the mesh.
        mesh: usize,
        /// Number of indices.
        count: usize,
    },
}

/// All geometry of a scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SceneGeometry {
    /// Meshes, each with one material.
    pub meshes: Vec<SceneMesh>,
    /// Materials of the meshes.
    pub materials: Vec<SceneMaterial>,
    /// Textures of the materials.
    pub textures: Vec<SceneTexture>,
    /// Warnings about unsupported parts of the source, as sentences.
    pub warnings: Vec<String>,
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
        for (mesh, data) in self.meshes.iter().enumerate() {
            let positions = data.positions.len();
            for (attribute, found) in [
                ("normals", data.normals.len()),
                ("uvs", data.uvs.len()),
                ("colors", data.colors.len()),
            ] {
                if found != positions {
                    return Err(GeometryError::AttributeLength {
                        mesh,
                        attribute,
                        positions,
                        found,
                    });
                }
            }
            if data.indices.len() % 3 != 0 {
                return Err(GeometryError::PartialTriangle { mesh, count: data.indices.len() });
            }
            let greatest = data.indices.iter().max().map(|index| *index as usize);
            let texture =
                self.materials.get(data.material).and_then(|material| material.base_color_texture);
            for (what, index, count) in [
                ("vertex", greatest, positions),
                ("material", Some(data.material), self.materials.len()),
                ("texture", texture, self.textures.len()),
            ] {
                if let Some(index) = index.filter(|index| *index >= count) {
                    return Err(GeometryError::OutOfRange { mesh, what, index, count });
                }
            }
        }
        Ok(())
    }

    /// Equivalent geometry with as few materials as possible: base colours move into the vertex
    /// colours, and meshes whose materials are then equal are merged. Empty meshes and unused
    /// materials are removed.
    ///
    /// Every material costs a bind, and some software renderers even compile a shader per bind and
    /// frame.
    #[must_use]
    pub fn merge(self) -> Self {
        let mut merged =
            Self { textures: self.textures, warnings: self.warnings, ..Self::default() };
        let mut slots = HashMap::new();
        for mesh in self.meshes {
            let Some(material) =
                self.materials.get(mesh.material).filter(|_| !mesh.indices.is_empty())
            else {
                continue;
            };
            let slot = *slots.entry(material.merge_key()).or_insert_with(|| {
                merged.materials.push(SceneMaterial { base_color: [1.0; 4], ..material.clone() });
                merged.meshes.push(SceneMesh {
                    material: merged.materials.len() - 1,
                    ..SceneMesh::default()
                });
                merged.meshes.len() - 1
            });
            let target = &mut merged.meshes[slot];
            let first = target.positions.len() as u32;
            target.positions.extend(mesh.positions);
            target.normals.extend(mesh.normals);
            target.uvs.extend(mesh.uvs);
            target.colors.extend(mesh.colors.iter().map(|color| {
                std::array::from_fn::<_, 4, _>(|i| color[i] * material.base_color[i])
            }));
            target.indices.extend(mesh.indices.iter().map(|index| index + first));
        }
        merged
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
    fn merging_moves_base_colors_into_vertices_and_keeps_every_triangle() {
        let before = geometry();
        let after = before.clone().merge();
        assert_eq!(after.validate(), Ok(()));
        assert_eq!((after.meshes.len(), after.materials.len(), after.triangle_count()), (2, 2, 4));
        assert!(after.materials.iter().all(|material| material.base_color == [1.0; 4]));
        assert_eq!(after.meshes[0].colors[0], [0.5, 0.0, 0.0, 1.0]);
        assert_eq!(after.meshes[0].colors[3], [0.0, 0.5, 0.0, 1.0]);
        let mut corners: Vec<_> =
            before.triangles().map(|triangle| triangle.corners[0].x).collect();
        let mut merged: Vec<_> = after.triangles().map(|triangle| triangle.corners[0].x).collect();
        corners.sort_by(f32::total_cmp);
        merged.sort_by(f32::total_cmp);
        assert_eq!(corners, merged);
        assert_eq!(before.bounds(), after.bounds());
    }

    #[test]
    fn broken_geometry_is_named() {
        let mut broken = geometry();
        broken.meshes[1].indices[2] = 3;
        assert_eq!(
            broken.validate(),
            Err(GeometryError::OutOfRange { mesh: 1, what: "vertex", index: 3, count: 3 })
        );
        assert_eq!(broken.triangles().count(), 3);
        let mut broken = geometry();
        broken.meshes[2].uvs.pop();
        assert!(matches!(
            broken.validate(),
            Err(GeometryError::AttributeLength { mesh: 2, attribute: "uvs", .. })
        ));
        let mut broken = geometry();
        broken.materials[2].base_color_texture = Some(0);
        assert!(matches!(
            broken.validate(),
            Err(GeometryError::OutOfRange { what: "texture", .. })
        ));
        let mut broken = geometry();
        broken.meshes[0].indices.pop();
        assert_eq!(broken.validate(), Err(GeometryError::PartialTriangle { mesh: 0, count: 2 }));
    }
}

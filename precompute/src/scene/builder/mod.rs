//! Mesh construction in code: quads, boxes, arches, cylinders, spheres, sheets.

mod arch;
mod round;

use glam::{Quat, Vec2, Vec3};

use super::SceneMesh;
pub(crate) use arch::ArchShape;

/// Selection of a box's six faces for [`MeshBuilder::cuboid`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Faces(u8);

impl Faces {
    /// All six: a closed solid.
    pub(crate) const ALL: Self = Self(0b11_1111);
    /// The face towards −Y.
    pub(crate) const BOTTOM: Self = Self(0b00_1000);
    /// The face towards +Y.
    pub(crate) const TOP: Self = Self(0b00_0100);

    /// These faces without `other`.
    pub(crate) const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }
}

/// Collects triangles in metres, Y up, counter-clockwise seen from their front, with normals,
/// texture coordinates and a tint.
///
/// Texture coordinates of flat faces are world positions projected along the face normal's greatest
/// axis, so that masonry is continuous across neighbouring faces;
/// [`texture_scale`](Self::texture_scale) sets the size of one repeat.
#[derive(Clone, Debug)]
pub(crate) struct MeshBuilder {
    mesh: SceneMesh,
    tint: [f32; 4],
    metres_per_repeat: f32,
    texture_turn: f32,
}

impl Default for MeshBuilder {
    fn default() -> Self {
        Self::new()
    }
}

impl MeshBuilder {
    /// An empty builder: white tint, one texture repeat per metre.
    pub(crate) fn new() -> Self {
        Self {
            mesh: SceneMesh::default(),
            tint: [1.0; 4],
            metres_per_repeat: 1.0,
            texture_turn: 0.0,
        }
    }

    /// Sets the linear RGB tint of subsequent geometry, each in [0, 1].
    pub(crate) fn tint(&mut self, [red, green, blue]: [f32; 3]) -> &mut Self {
        self.tint = [red, green, blue, 1.0];
        self
    }

    /// Sets the size of one texture repeat on subsequent flat faces, metres, greater than 0.
    pub(crate) fn texture_scale(&mut self, metres_per_repeat: f32) -> &mut Self {
        self.metres_per_repeat = metres_per_repeat;
        self
    }

    /// Sets the rotation of the texture on subsequent flat faces, radians.
    pub(crate) fn texture_turn(&mut self, angle: f32) -> &mut Self {
        self.texture_turn = angle;
        self
    }

    /// The mesh, with `material` as its material's index.
    pub(crate) fn finish(self, material: usize) -> SceneMesh {
        SceneMesh { material, ..self.mesh }
    }

    /// Number of triangles so far.
    #[cfg(test)]
    pub(crate) fn triangle_count(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    /// Adds a vertex and returns its index.
    pub(crate) fn vertex(&mut self, position: Vec3, normal: Vec3, uv: Vec2) -> u32 {
        self.mesh.positions.push(position);
        self.mesh.normals.push(normal);
        self.mesh.uvs.push(uv);
        self.mesh.colors.push(self.tint);
        self.mesh.positions.len() as u32 - 1
    }

    /// Adds a triangle of vertices from [`vertex`](Self::vertex), counter-clockwise from its front.
    pub(crate) fn triangle(&mut self, a: u32, b: u32, c: u32) {
        self.mesh.indices.extend([a, b, c]);
    }

    fn project(&self, position: Vec3, normal: Vec3) -> Vec2 {
        let size = normal.abs();
        let flat = if size.y >= size.x && size.y >= size.z {
            Vec2::new(position.x, position.z)
        } else if size.x >= size.z {
            Vec2::new(position.z, -position.y)
        } else {
            Vec2::new(position.x, -position.y)
        };
        Vec2::from_angle(self.texture_turn).rotate(flat) / self.metres_per_repeat
    }

    /// A flat convex polygon, its corners counter-clockwise from its front; fewer than three
    /// corners add nothing.
    pub(crate) fn polygon(&mut self, corners: &[Vec3]) {
        // Newell's sum: the area vector of any polygon, robust to three consecutive collinear
        // corners.
        let area: Vec3 =
            (0..corners.len()).map(|i| corners[i].cross(corners[(i + 1) % corners.len()])).sum();
        let normal = area.normalize_or_zero();
        let first = self.mesh.positions.len() as u32;
        for corner in corners {
            let uv = self.project(*corner, normal);
            self.vertex(*corner, normal, uv);
        }
        for i in 2..corners.len() as u32 {
            self.triangle(first, first + i - 1, first + i);
        }
    }

    /// A flat quadrilateral, its corners counter-clockwise from its front.
    pub(crate) fn quad(&mut self, corners: [Vec3; 4]) {
        self.polygon(&corners);
    }

    /// An axis-aligned box that is solid (front faces outward) between two opposite corners.
    pub(crate) fn cuboid(&mut self, min: Vec3, max: Vec3, faces: Faces) {
        self.turned_cuboid((min + max) * 0.5, (max - min) * 0.5, Quat::IDENTITY, faces);
    }

    /// A solid box around `center` with half extent `half_size`, rotated by `rotation`.
    pub(crate) fn turned_cuboid(
        &mut self,
        center: Vec3,
        half_size: Vec3,
        rotation: Quat,
        faces: Faces,
    ) {
        for (bit, axis) in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
            .into_iter()
            .enumerate()
        {
            if faces.0 & (1 << bit) != 0 {
                let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
                let right = up.cross(axis);
                let corner =
                    |r: f32, u: f32| center + rotation * ((axis + right * r + up * u) * half_size);
                self.quad([
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ]);
            }
        }
    }

    /// The inside of a box: front faces inward.
    pub(crate) fn room(&mut self, min: Vec3, max: Vec3) {
        // A negative half size flips each face without moving it.
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            let right = up.cross(axis);
            let corner = |r: f32, u: f32| center + (axis + right * r + up * u) * half;
            self.quad([corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that normals are unit vectors, and within the angle of cosine `least` of their triangles'.
    pub(super) fn normals_agree(mesh: &SceneMesh, least: f32) {
        for triangle in mesh.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i| mesh.positions[triangle[i] as usize]);
            let geometric = (b - a).cross(c - a).normalize();
            for index in triangle {
                let normal = mesh.normals[*index as usize];
                assert!((normal.length() - 1.0).abs() < 1e-4);
                assert!(
                    normal.dot(geometric) > least,
                    "{normal} against {geometric} at {a} {b} {c}"
                );
            }
        }
    }

    #[test]
    fn boxes_face_outward_and_rooms_inward() {
        let mut builder = MeshBuilder::new();
        builder.cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), Faces::ALL);
        let solid = builder.clone().finish(0);
        normals_agree(&solid, 0.999);
        let center = Vec3::new(0.5, 1.0, 1.5);
        assert!(
            solid
                .positions
                .iter()
                .zip(&solid.normals)
                .all(|(position, normal)| (*position - center).dot(*normal) > 0.0)
        );
        let mut builder = MeshBuilder::new();
        builder.room(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        let room = builder.finish(0);
        normals_agree(&room, 0.999);
        assert!(
            room.positions
                .iter()
                .zip(&room.normals)
                .all(|(position, normal)| (*position - center).dot(*normal) < 0.0)
        );
        let mut open = MeshBuilder::new();
        open.cuboid(Vec3::ZERO, Vec3::ONE, Faces::ALL.without(Faces::TOP).without(Faces::BOTTOM));
        assert_eq!(open.triangle_count(), 8);
        assert!(open.finish(0).normals.iter().all(|normal| normal.y.abs() < 1e-6));
    }
}

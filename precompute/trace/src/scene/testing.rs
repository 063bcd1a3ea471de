//! Geometry for tests, made in code: quads, boxes, rooms, spheres, sheets.

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::SceneMesh;

/// Collects triangles in metres, Y up, counter-clockwise seen from their front, with normals,
/// texture coordinates and a tint.
#[derive(Clone, Debug)]
pub(crate) struct MeshBuilder {
    mesh: SceneMesh,
    tint: [f32; 4],
}

impl MeshBuilder {
    /// An empty builder with a white tint.
    pub(crate) fn new() -> Self {
        Self { mesh: SceneMesh::default(), tint: [1.0; 4] }
    }

    /// Sets the linear RGB tint of subsequent geometry, each in [0, 1].
    pub(crate) fn tint(&mut self, [red, green, blue]: [f32; 3]) -> &mut Self {
        self.tint = [red, green, blue, 1.0];
        self
    }

    /// The mesh, with `material` as its material's index.
    pub(crate) fn finish(self, material: usize) -> SceneMesh {
        SceneMesh { material, ..self.mesh }
    }

    /// Number of triangles so far.
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

    /// A flat quadrilateral, its corners counter-clockwise from its front.
    pub(crate) fn quad(&mut self, corners: [Vec3; 4]) {
        let [a, b, c, d] = corners;
        let normal = (c - a).cross(d - b).normalize_or_zero();
        let [a, b, c, d] = [a, b, c, d].map(|corner| self.vertex(corner, normal, Vec2::ZERO));
        self.triangle(a, b, c);
        self.triangle(a, c, d);
    }

    /// A box that is solid: front faces outward.
    pub(crate) fn cuboid(&mut self, min: Vec3, max: Vec3) {
        self.faces(min, max, |[a, b, c, d]| [a, b, c, d]);
    }

    /// The inside of a box: front faces inward.
    pub(crate) fn room(&mut self, min: Vec3, max: Vec3) {
        self.faces(min, max, |[a, b, c, d]| [a, d, c, b]);
    }

    fn faces(&mut self, min: Vec3, max: Vec3, order: impl Fn([Vec3; 4]) -> [Vec3; 4]) {
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
            let right = up.cross(axis);
            let corner = |r: f32, u: f32| center + (axis + right * r + up * u) * half;
            let outward =
                [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            self.quad(order(outward));
        }
    }

    /// A sphere by splitting an icosahedron's triangles in four `subdivisions` times (20 · 4ⁿ
    /// triangles), with exactly radial normals; `inward` flips faces and normals. Neighbours share
    /// vertices.
    pub(crate) fn icosphere(&mut self, center: Vec3, radius: f32, subdivisions: u32, inward: bool) {
        let (mut points, mut faces) = icosahedron();
        for _ in 0..subdivisions {
            let mut middles = HashMap::new();
            faces = faces
                .iter()
                .flat_map(|&[a, b, c]| {
                    let mut middle = |from: u32, to: u32| {
                        *middles.entry((from.min(to), from.max(to))).or_insert_with(|| {
                            points.push((points[from as usize] + points[to as usize]).normalize());
                            points.len() as u32 - 1
                        })
                    };
                    let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let first = self.mesh.positions.len() as u32;
        let sign = if inward { -1.0 } else { 1.0 };
        for point in points {
            let uv =
                Vec2::new(point.x.atan2(point.z) / TAU + 0.5, point.y.clamp(-1.0, 1.0).acos() / PI);
            self.vertex(center + point * radius, point * sign, uv);
        }
        for [a, b, c] in faces {
            if inward {
                self.triangle(first + a, first + c, first + b);
            } else {
                self.triangle(first + a, first + b, first + c);
            }
        }
    }

    /// A curved sheet: `surface` maps (s, t) in [0, 1]² to a world position, metres; seen from the
    /// front, s increases to the right and t upwards. Smooth normals; texture coordinates are (s, 1
    /// − t).
    pub(crate) fn sheet(&mut self, columns: u32, rows: u32, surface: impl Fn(f32, f32) -> Vec3) {
        let (columns, rows) = (columns.max(1), rows.max(1));
        let first = self.mesh.positions.len() as u32;
        let step = 1e-3;
        for row in 0..=rows {
            for column in 0..=columns {
                let (s, t) = (column as f32 / columns as f32, row as f32 / rows as f32);
                let right = surface(s + step, t) - surface(s - step, t);
                let up = surface(s, t + step) - surface(s, t - step);
                self.vertex(
                    surface(s, t),
                    right.cross(up).normalize_or(Vec3::Z),
                    Vec2::new(s, 1.0 - t),
                );
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let d = a + columns + 1;
                self.triangle(a, a + 1, d + 1);
                self.triangle(a, d + 1, d);
            }
        }
    }
}

/// Unit icosahedron: points and counter-clockwise faces.
fn icosahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0_f32.sqrt()) / 2.0;
    let mut points = Vec::with_capacity(12);
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        points.extend(
            [Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)].map(Vec3::normalize),
        );
    }
    // Faces are the triples of mutual neighbours: all edges are equally long, 1.05 on the unit
    // sphere; other pairs are 1.7 or more apart.
    let near = |i: usize, j: usize| points[i].distance_squared(points[j]) < 1.5;
    let mut faces = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward =
                        (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    faces.push(if outward { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    (points, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that normals are unit vectors, and within the angle of cosine `least` of their triangles'.
    fn normals_agree(mesh: &SceneMesh, least: f32) {
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
        builder.cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
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
    }

    #[test]
    fn spheres_are_radial_and_round() {
        for inward in [false, true] {
            let mut builder = MeshBuilder::new();
            builder.icosphere(Vec3::ONE, 2.0, 2, inward);
            assert_eq!(builder.triangle_count(), 320);
            let mesh = builder.finish(0);
            assert_eq!(mesh.positions.len(), 162, "neighbours share vertices");
            normals_agree(&mesh, 0.9);
            let sign = if inward { -1.0 } else { 1.0 };
            for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
                assert!(((*position - Vec3::ONE) * 0.5 * sign - *normal).length() < 1e-5);
            }
        }
    }

    #[test]
    fn a_sheet_has_valid_normals() {
        let mut builder = MeshBuilder::new();
        builder.sheet(8, 8, |s, t| Vec3::new(s, t, 0.1 * (s * 9.0).sin()));
        let sheet = builder.finish(0);
        normals_agree(&sheet, 0.8);
        assert!(sheet.normals.iter().all(|normal| normal.z > 0.0));
    }
}

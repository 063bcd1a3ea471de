//! Mesh construction in code: quads, boxes, arches, cylinders, spheres, sheets.

use super::SceneMesh;
use glam::{Quat, Vec2, Vec3};
use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

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

    /// An upright pillar or cone: `profile` gives (height above `base`, radius) from bottom to top,
    /// in metres; smooth around, flat along. At least three `sides`. A ring of radius 0 closes the
    /// solid; other ends stay open.
    pub(crate) fn lathe(&mut self, base: Vec3, profile: &[(f32, f32)], sides: u32) {
        let sides = sides.max(3);
        for ring in profile.windows(2) {
            let [(low, low_radius), (high, high_radius)] = [ring[0], ring[1]];
            // The normal follows the slope of the profile.
            let slope = Vec2::new(high - low, low_radius - high_radius).normalize_or(Vec2::X);
            let first = self.mesh.positions.len() as u32;
            for side in 0..=sides {
                let angle = side as f32 / sides as f32 * TAU;
                let outward = Vec3::new(angle.sin(), 0.0, angle.cos());
                let normal = outward * slope.x + Vec3::Y * slope.y;
                let along = angle / TAU
                    * (TAU * low_radius.max(high_radius) / self.metres_per_repeat).round().max(1.0);
                for (height, radius) in [(low, low_radius), (high, high_radius)] {
                    let position = base + outward * radius + Vec3::Y * height;
                    self.vertex(
                        position,
                        normal,
                        Vec2::new(along, -position.y / self.metres_per_repeat),
                    );
                }
            }
            for side in 0..sides {
                let [a, b, c, d] = [0, 2, 3, 1].map(|corner| first + side * 2 + corner);
                if low_radius > 0.0 {
                    self.triangle(a, b, c);
                }
                if high_radius > 0.0 {
                    self.triangle(a, c, d);
                }
            }
        }
    }

    /// A wall with a round arch over an opening from the wall's foot.
    ///
    /// `left` is the foot of the wall's left end seen from the front, `right` its right end,
    /// metres; the wall goes `top` metres up from there and is `thickness` deep, half on either
    /// side. The arch springs at `spring` metres and its radius is `radius`; the remaining width at
    /// each side is a jamb from `jamb_foot` metres up. Adds front, back and the arch's underside,
    /// and the wall's top if `with_top`.
    pub(crate) fn arch(&mut self, left: Vec3, right: Vec3, shape: ArchShape) {
        let along = (right - left).normalize_or(Vec3::X);
        let width = (right - left).length();
        let front = along.cross(Vec3::Y) * (shape.thickness * 0.5);
        let point = |x: f32, y: f32| left + along * x + Vec3::Y * y;
        let radius = shape.radius.min(width * 0.5);
        let segments = shape.segments.max(2);
        let rim: Vec<Vec2> = (0..=segments)
            .map(|i| {
                let angle = PI * (1.0 - i as f32 / segments as f32);
                Vec2::new(width * 0.5 + radius * angle.cos(), shape.spring + radius * angle.sin())
            })
            .collect();
        let jamb = width * 0.5 - radius;
        let mut faces: Vec<[Vec2; 4]> = rim
            .windows(2)
            .map(|pair| {
                [pair[0], pair[1], Vec2::new(pair[1].x, shape.top), Vec2::new(pair[0].x, shape.top)]
            })
            .collect();
        if jamb > 1e-4 {
            let (foot, top) = (shape.jamb_foot, shape.top);
            for (from, to) in [(0.0, jamb), (width - jamb, width)] {
                faces.push([
                    Vec2::new(from, foot),
                    Vec2::new(to, foot),
                    Vec2::new(to, top),
                    Vec2::new(from, top),
                ]);
            }
        }
        for face in faces {
            self.quad(face.map(|corner| point(corner.x, corner.y) + front));
            let [a, b, c, d] = face.map(|corner| point(corner.x, corner.y) - front);
            self.quad([d, c, b, a]);
        }
        // The underside is smooth: its normals point to the arch's axis.
        let axis = Vec2::new(width * 0.5, shape.spring);
        let first = self.mesh.positions.len() as u32;
        for (i, corner) in rim.iter().enumerate() {
            let inward = (axis - *corner).normalize_or(Vec2::NEG_Y);
            let normal = along * inward.x + Vec3::Y * inward.y;
            let length = PI * radius * i as f32 / segments as f32;
            for (side, depth) in [(front, 0.0), (-front, shape.thickness)] {
                let uv = Vec2::new(depth, length) / self.metres_per_repeat;
                self.vertex(point(corner.x, corner.y) + side, normal, uv);
            }
        }
        for i in 0..segments {
            let [a, b, c, d] = [0, 1, 3, 2].map(|corner| first + i * 2 + corner);
            self.triangle(a, b, c);
            self.triangle(a, c, d);
        }
        if jamb > 1e-4 && shape.jamb_foot < shape.spring {
            for (x, outward) in [(jamb, 1.0), (width - jamb, -1.0)] {
                let (low, high) = (point(x, shape.jamb_foot), point(x, shape.spring));
                let side = front * outward;
                self.quad([low + side, low - side, high - side, high + side]);
            }
        }
        if shape.with_top {
            let (a, b) = (point(0.0, shape.top), point(width, shape.top));
            self.quad([a + front, b + front, b - front, a - front]);
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
    /// − t) · `repeats`.
    pub(crate) fn sheet(
        &mut self,
        columns: u32,
        rows: u32,
        repeats: Vec2,
        surface: impl Fn(f32, f32) -> Vec3,
    ) {
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
                    Vec2::new(s, 1.0 - t) * repeats,
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

/// Measures of [`MeshBuilder::arch`], metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ArchShape {
    /// Height of the wall's top above its foot.
    pub top: f32,
    /// Height at which the arch begins to curve.
    pub spring: f32,
    /// Radius of the arch; at most half the wall's width.
    pub radius: f32,
    /// Height at which the masonry beside the opening begins.
    pub jamb_foot: f32,
    /// Depth of the wall.
    pub thickness: f32,
    /// Number of straight segments of the half circle, at least 2.
    pub segments: u32,
    /// Whether the wall's top face is added.
    pub with_top: bool,
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
    fn curved_surfaces_have_valid_normals() {
        let mut builder = MeshBuilder::new();
        builder.lathe(Vec3::ZERO, &[(0.0, 0.4), (1.0, 0.3), (1.2, 0.5), (1.5, 0.0)], 12);
        normals_agree(&builder.finish(0), 0.9);
        let mut builder = MeshBuilder::new();
        let shape = ArchShape {
            top: 4.0,
            spring: 2.0,
            radius: 0.9,
            jamb_foot: 0.0,
            thickness: 0.3,
            segments: 8,
            with_top: true,
        };
        builder.arch(Vec3::ZERO, Vec3::X * 2.4, shape);
        let arch = builder.finish(0);
        normals_agree(&arch, 0.9);
        assert!(
            arch.positions
                .iter()
                .all(|p| p.z.abs() < 0.151 && p.y < 4.001 && p.x > -0.001 && p.x < 2.401)
        );
        let mut builder = MeshBuilder::new();
        builder.sheet(8, 8, Vec2::ONE, |s, t| Vec3::new(s, t, 0.1 * (s * 9.0).sin()));
        let sheet = builder.finish(0);
        normals_agree(&sheet, 0.8);
        assert!(sheet.normals.iter().all(|normal| normal.z > 0.0));
    }
}

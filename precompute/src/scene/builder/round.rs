//! Curved surfaces: turned profiles, spheres, sheets.

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::MeshBuilder;

impl MeshBuilder {
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
    use super::super::tests::normals_agree;
    use super::*;

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
    fn a_lathe_has_valid_normals() {
        let mut builder = MeshBuilder::new();
        builder.lathe(Vec3::ZERO, &[(0.0, 0.4), (1.0, 0.3), (1.2, 0.5), (1.5, 0.0)], 12);
        normals_agree(&builder.finish(0), 0.9);
    }

    #[test]
    fn a_sheet_has_valid_normals() {
        let mut builder = MeshBuilder::new();
        builder.sheet(8, 8, Vec2::ONE, |s, t| Vec3::new(s, t, 0.1 * (s * 9.0).sin()));
        let sheet = builder.finish(0);
        normals_agree(&sheet, 0.8);
        assert!(sheet.normals.iter().all(|normal| normal.z > 0.0));
    }
}

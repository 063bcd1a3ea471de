//! Walls with a round arch.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::MeshBuilder;

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

impl MeshBuilder {
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
}

#[cfg(test)]
mod tests {
    use super::super::tests::normals_agree;
    use super::*;

    #[test]
    fn an_arch_has_valid_normals_and_stays_inside_its_wall() {
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
    }
}

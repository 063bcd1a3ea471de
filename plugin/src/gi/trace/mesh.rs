//! A mesh's triangles in a tree, with opacity micromaps of alpha masks, and an instance of it.
//!
//! A triangle is divided into 8 × 8 equal micro-triangles, with one bit of opacity each (Gruen,
//! Benthin and Woop 2020, "Sub-triangle Opacity Masks for Faster Ray Tracing of Transparent
//! Objects"). The 64 bits lie in the padding of a triangle's three vectors: holes take no memory
//! and no texture reads, and cost nothing for rays that hit no triangle.

use bevy::math::{Affine3A, Vec3, Vec3A};
use bytemuck::{Pod, Zeroable};

use super::wide::{WideBvh, WideNode};
use crate::gi::surfaces::{MAX_COORDINATE, is_in_range};

/// Triangles whose area, relative to their box's greatest side squared, is smaller than this are
/// left out: they occlude nothing, and their determinant vanishes.
const MIN_AREA: f32 = 1e-12;

/// Micro-triangles along each side of a triangle.
const SIDE: u32 = 8;
/// Samples of the mask in each micro-triangle. Higher values resolve many holes in one triangle
/// better, and take longer.
const SAMPLES: u32 = 8;

/// A triangle without holes.
pub(crate) const SOLID: u64 = u64::MAX;

/// `trace/trace.wgsl`'s `Triangle`: a corner and two edges, and an opacity micromap.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct TriangleWords {
    /// The first corner.
    pub corner: [f32; 3],
    padding: u32,
    /// From there to the second.
    pub edge_1: [f32; 3],
    /// The micromap's lower half.
    map_low: u32,
    /// From the first corner to the third.
    pub edge_2: [f32; 3],
    /// Its upper half.
    map_high: u32,
}

impl TriangleWords {
    fn new([a, b, c]: [Vec3; 3], map: u64) -> Self {
        let [corner, edge_1, edge_2] = [a, b - a, c - a].map(|v| v.to_array());
        Self {
            corner,
            padding: 0,
            edge_1,
            map_low: map as u32,
            edge_2,
            map_high: (map >> 32) as u32,
        }
    }
}

/// One mesh's triangles in a tree, in the mesh's own space.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MeshBvh {
    /// The tree's nodes.
    pub nodes: Vec<WideNode>,
    /// Triangles in the order in which leaves name them.
    pub triangles: Vec<TriangleWords>,
    /// Lower and upper corner of the box around them; `None` without any.
    bounds: Option<(Vec3A, Vec3A)>,
}

impl MeshBvh {
    /// A tree of triangles, each with its micromap. Triangles that are all hole, degenerate, not
    /// finite or too far away are left out.
    pub(crate) fn new(triangles: impl IntoIterator<Item = ([Vec3; 3], u64)>) -> Self {
        let triangles: Vec<_> = triangles
            .into_iter()
            .filter(|(triangle, map)| *map != 0 && is_usable(triangle))
            .collect();
        let boxes: Vec<_> = triangles
            .iter()
            .map(|([a, b, c], _)| (a.min(*b).min(*c).into(), a.max(*b).max(*c).into()))
            .collect();
        let WideBvh { nodes, order } = WideBvh::new(&boxes);
        let bounds = boxes.into_iter().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let words = |index: &u32| {
            let (triangle, map) = triangles[*index as usize];
            TriangleWords::new(triangle, map)
        };
        Self { triangles: order.iter().map(words).collect(), nodes, bounds }
    }

    /// The box around it in a space that `affine` maps its own to; `None` where that is not finite
    /// or there is nothing.
    pub(crate) fn bounds(&self, affine: &Affine3A) -> Option<(Vec3A, Vec3A)> {
        let (min, max) = self.bounds?;
        let center = affine.transform_point3a((min + max) * 0.5);
        let half = affine.matrix3.abs() * ((max - min) * 0.5);
        let (min, max) = (center - half, center + half);
        (min.is_finite()
            && max.is_finite()
            && max.abs().max(min.abs()).max_element() < MAX_COORDINATE)
            .then_some((min, max))
    }
}

fn is_usable(triangle: &[Vec3; 3]) -> bool {
    let [a, b, c] = *triangle;
    let side = (b - a).abs().max((c - a).abs()).max_element();
    // In units of its own size, so that neither tiny nor huge triangles leave the range of a float.
    is_in_range(triangle)
        && side > 0.0
        && ((b - a) / side).cross((c - a) / side).length() > MIN_AREA
}

/// `trace/trace.wgsl`'s `Instance`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Instance {
    /// Rows of the matrix from the world to the mesh.
    pub local_from_world: [[f32; 4]; 3],
    /// The mesh's first node, or [`NOTHING`](Self::NOTHING).
    pub root: u32,
    pub padding: [u32; 3],
}

impl Instance {
    /// The root of an instance that is gone.
    pub(super) const NOTHING: u32 = u32::MAX;
}

/// An instance of a mesh's tree, and its box; `None` where it is scaled to nothing or out of the
/// range of floats, and occludes nothing.
pub(super) fn instance(
    tree: &MeshBvh,
    root: u32,
    affine: &Affine3A,
) -> Option<(Instance, (Vec3A, Vec3A))> {
    let inverse = affine.inverse();
    let bounds = tree.bounds(affine).filter(|_| inverse.is_finite())?;
    let [x, y, z] = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis]
        .map(|axis| axis.to_array());
    let offset = inverse.translation.to_array();
    let local_from_world = std::array::from_fn(|row| [x[row], y[row], z[row], offset[row]]);
    Some((Instance { local_from_world, root, padding: [0; 3] }, bounds))
}

/// The micromap of a mask. `is_opaque`: whether a point, given by barycentric weights of the second
/// and third corner (each in [0, 1], together at most 1), is opaque.
///
/// A partly opaque micro-triangle is rounded to one or the other, and its rounding error is carried
/// on to the next (error diffusion), so that the triangle keeps its share of holes.
pub(crate) fn micromap(mut is_opaque: impl FnMut([f32; 2]) -> bool) -> u64 {
    let (mut map, mut carried, mut number) = (0, 0, 0);
    for (index, micro_triangle) in micro_triangles().enumerate() {
        let mut count = 0;
        for _ in 0..SAMPLES {
            number += 1;
            count += i32::from(is_opaque(micro_triangle(spread(number))));
        }
        carried += count;
        if 2 * carried >= SAMPLES as i32 {
            map |= 1 << index;
            carried -= SAMPLES as i32;
        }
    }
    map
}

/// All micro-triangles in the order of their bits, as in `trace.wgsl`: what maps a point of the unit
/// square to weights in each.
fn micro_triangles() -> impl Iterator<Item = impl Fn([f32; 2]) -> [f32; 2]> {
    let all = (0..SIDE).flat_map(|row| (0..2 * (SIDE - row) - 1).map(move |i| (row, i)));
    all.map(|(row, i)| {
        move |[across, along]: [f32; 2]| {
            let [row, column] = [row as f32, (i / 2) as f32];
            let (across, along) =
                if across + along > 1.0 { (1.0 - across, 1.0 - along) } else { (across, along) };
            // Of the two there, the second is inverted.
            let point = if i % 2 == 1 {
                [row + 1.0 - across, column + 1.0 - along]
            } else {
                [row + across, column + along]
            };
            point.map(|weight| weight / SIDE as f32)
        }
    })
}

/// The R2 sequence: evenly distributed over the unit square, without aliasing with repeating
/// textures (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
fn spread(number: u32) -> [f32; 2] {
    [0.754_877_666_246_692_8, 0.569_840_290_998_053_3]
        .map(|step: f64| (f64::from(number) * step).fract() as f32)
}

#[cfg(test)]
#[path = "mesh_tests.rs"]
mod tests;

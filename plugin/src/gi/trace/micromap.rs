//! Opacity micromaps of alpha masks on triangles: plain Rust, no renderer.
//!
//! A triangle is divided into 8 × 8 equal micro-triangles, with one bit of opacity each (Gruen,
//! Benthin and Woop 2020, "Sub-triangle Opacity Masks for Faster Ray Tracing of Transparent
//! Objects"). The 64 bits lie in the padding of a triangle's three vectors: holes take no memory
//! and no texture reads, and cost nothing for rays that hit no triangle.

/// Micro-triangles along each side of a triangle.
const SIDE: u32 = 8;
/// Samples of the mask in each micro-triangle. Higher values resolve many holes in one triangle
/// better, and take longer.
const SAMPLES: u32 = 8;

/// A triangle without holes.
pub(crate) const SOLID: u64 = u64::MAX;

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
            count += i32::from(is_opaque(micro_triangle.point(spread(number))));
        }
        carried += count;
        if 2 * carried >= SAMPLES as i32 {
            map |= 1 << index;
            carried -= SAMPLES as i32;
        }
    }
    map
}

/// A micro-triangle: its row and column, and whether it is the inverted one of the two there.
struct MicroTriangle {
    row: u32,
    column: u32,
    turned: bool,
}

impl MicroTriangle {
    fn point(&self, [across, along]: [f32; 2]) -> [f32; 2] {
        let [row, column] = [self.row as f32, self.column as f32];
        let (across, along) =
            if across + along > 1.0 { (1.0 - across, 1.0 - along) } else { (across, along) };
        let point = if self.turned {
            [row + 1.0 - across, column + 1.0 - along]
        } else {
            [row + across, column + along]
        };
        point.map(|weight| weight / SIDE as f32)
    }
}

/// All micro-triangles in the order of their bits, as in `trace.wgsl`.
fn micro_triangles() -> impl Iterator<Item = MicroTriangle> {
    (0..SIDE).flat_map(|row| {
        (0..2 * (SIDE - row) - 1).map(move |i| MicroTriangle {
            row,
            column: i / 2,
            turned: i % 2 == 1,
        })
    })
}

/// The R2 sequence: evenly distributed over the unit square, without aliasing with repeating
/// textures (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
fn spread(number: u32) -> [f32; 2] {
    [0.754_877_666_246_692_8, 0.569_840_290_998_053_3]
        .map(|step: f64| (f64::from(number) * step).fract() as f32)
}

/// Whether the micro-triangle at a point is opaque: the twin of `trace.wgsl`'s.
#[cfg(test)]
pub(crate) fn is_opaque(map: u64, [second, third]: [f64; 2]) -> bool {
    let side = f64::from(SIDE);
    let row = ((second * side) as u64).min(7);
    let column = ((third * side) as u64).min(7 - row);
    let turned =
        second * side - row as f64 + third * side - column as f64 > 1.0 && column < 7 - row;
    map >> (row * (16 - row) + 2 * column + u64::from(turned)) & 1 == 1
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_opaque_mask_is_solid_and_a_clear_one_is_all_hole() {
        assert_eq!(micromap(|_| true), SOLID);
        assert_eq!(micromap(|_| false), 0);
    }

    #[test]
    fn each_bit_is_one_micro_triangle() {
        let points: Vec<[f32; 2]> =
            micro_triangles().map(|micro_triangle| micro_triangle.point([0.3, 0.3])).collect();
        assert_eq!(points.len(), 64);
        for (index, point) in points.iter().enumerate() {
            assert!(
                point[0] + point[1] < 1.0 && point.iter().all(|weight| *weight > 0.0),
                "{point:?}"
            );
            for other in 0..64 {
                assert_eq!(
                    is_opaque(1 << other, point.map(f64::from)),
                    other == index,
                    "bit {other} at {point:?}"
                );
            }
        }
        // Corners and edges belong to some micro-triangle.
        for corner in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.875, 0.125]] {
            assert!(is_opaque(SOLID, corner) && !is_opaque(0, corner));
        }
    }

    #[test]
    fn fine_holes_keep_their_share() {
        // A wire mesh, ever finer; also aligned with the micro-triangles.
        for repeats in [3.0f32, 8.0, 16.0, 37.0, 64.0] {
            for share in [0.1f32, 0.5, 0.9] {
                let map = micromap(|[u, v]| {
                    (u * repeats).fract() < share && (v * repeats).fract() >= 0.0
                });
                let found = map.count_ones() as f32 / 64.0;
                assert!(
                    (found - share).abs() < 0.08,
                    "{found} of {share}, repeated {repeats} times"
                );
            }
        }
    }

    proptest! {
        /// A mask cut by a straight line: only micro-triangles on the line may differ.
        #[test]
        fn coarse_holes_are_at_the_right_positions(angle in 0.0f64..6.3, at in 0.1f64..0.6, u in 0.0f64..1.0, v in 0.0f64..1.0) {
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let side = |u: f64, v: f64| (u - at) * angle.cos() + (v - 0.5 * at) * angle.sin();
            let map = micromap(|[u, v]| side(f64::from(u), f64::from(v)) > 0.0);
            // Farther from the line than a micro-triangle's longest side.
            if side(u, v).abs() > 0.18 {
                prop_assert_eq!(is_opaque(map, [u, v]), side(u, v) > 0.0);
            }
        }

        #[test]
        fn the_opaque_share_is_kept(share in 0.0f32..1.0, seed in 0u32..1000) {
            let mut state = seed;
            let mut count = 0;
            let map = micromap(|_| {
                state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                let there = ((state >> 8) as f32) < share * (1 << 24) as f32;
                count += u32::from(there);
                there
            });
            let exact = count as f32 / SAMPLES as f32;
            prop_assert!((map.count_ones() as f32 - exact).abs() <= 0.5, "{} micro-triangles of {exact}", map.count_ones());
        }
    }
}

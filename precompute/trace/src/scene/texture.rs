//! A texture with its mip chain, filtered in linear light.

use std::sync::LazyLock;

use crate::color::{linear_from_srgb, srgb_from_linear};

/// Linear light of the 256 values of a texel's channel.
static DECODED: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|value| linear_from_srgb(value as f32 / 255.0)));

/// An 8-bit sRGB texture with a full mip chain. It repeats in both directions.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SceneTexture {
    /// Width of level 0, texels, at least 1.
    pub width: u32,
    /// Height of level 0, texels, at least 1.
    pub height: u32,
    /// Level by level, each row by row from the top, (red, green, blue, alpha); colour is sRGB,
    /// alpha is linear. Level `i` has max(1, `width` >> i) × max(1, `height` >> i), down to 1 × 1.
    pub mips: Vec<Vec<u8>>,
}

impl SceneTexture {
    /// Builds the mip chain of `rgba8`, which must hold `width` × `height` texels; `None` if it
    /// does not, or if a side is 0.
    ///
    /// Colours are averaged in linear light, weighted by alpha, so that cut-out texels do not bleed
    /// into visible ones. With a `cutoff` every level's alpha is scaled so that the same share of
    /// texels passes it as in level 0: thin threads do not vanish with distance (Castaño 2010,
    /// "Computing Alpha Mipmaps").
    pub fn from_rgba8(
        width: u32,
        height: u32,
        rgba8: Vec<u8>,
        cutoff: Option<f32>,
    ) -> Option<Self> {
        let texels = (width as usize).checked_mul(height as usize)?;
        if texels == 0 || rgba8.len() != texels.checked_mul(4)? {
            return None;
        }
        let mut level: Vec<[f32; 4]> = rgba8
            .chunks_exact(4)
            .map(|texel| {
                let color = |i: usize| DECODED[texel[i] as usize];
                [color(0), color(1), color(2), f32::from(texel[3]) / 255.0]
            })
            .collect();
        let coverage = cutoff.map(|cutoff| (cutoff, coverage(&level, cutoff, 1.0)));
        let (mut level_width, mut level_height) = (width as usize, height as usize);
        let mut mips = vec![rgba8];
        while level_width > 1 || level_height > 1 {
            let (next_width, next_height) = ((level_width / 2).max(1), (level_height / 2).max(1));
            level = halve(&level, (level_width, level_height), (next_width, next_height));
            (level_width, level_height) = (next_width, next_height);
            let scale =
                coverage.map_or(1.0, |(cutoff, target)| alpha_scale(&level, cutoff, target));
            mips.push(level.iter().flat_map(|texel| encode(texel, scale)).collect());
        }
        Some(Self { width, height, mips })
    }

    /// Colour in linear light and alpha, each in [0, 1], at a texture coordinate: level 0, bilinear
    /// after decoding, with repeat, as the stage's sampler magnifies. (0, 0) is the upper left
    /// corner. A coordinate that is not finite counts as 0.
    pub fn sample(&self, u: f32, v: f32) -> [f32; 4] {
        // One neighbour on either side of the position, and the weight of the second; texel centres
        // are at half-integers.
        let neighbours = |coordinate: f32, size: u32| {
            let coordinate = if coordinate.is_finite() { f64::from(coordinate) } else { 0.0 };
            let position = coordinate.rem_euclid(1.0) * f64::from(size) - 0.5;
            let first = (position.floor() as i64).rem_euclid(i64::from(size)) as usize;
            ([first, (first + 1) % size as usize], (position - position.floor()) as f32)
        };
        let ((columns, right), (rows, down)) =
            (neighbours(u, self.width), neighbours(v, self.height));
        let mut sum = [0.0; 4];
        for (row, row_weight) in rows.into_iter().zip([1.0 - down, down]) {
            for (column, column_weight) in columns.into_iter().zip([1.0 - right, right]) {
                let texel = &self.mips[0][(row * self.width as usize + column) * 4..][..4];
                let linear = [0, 1, 2].map(|channel| DECODED[texel[channel] as usize]);
                let values = [linear[0], linear[1], linear[2], f32::from(texel[3]) / 255.0];
                (0..4).for_each(|channel| {
                    sum[channel] += values[channel] * row_weight * column_weight;
                });
            }
        }
        sum
    }

    /// Width and height of mip `level`, texels.
    pub fn mip_size(&self, level: usize) -> (u32, u32) {
        let shift = level.min(31) as u32;
        ((self.width >> shift).max(1), (self.height >> shift).max(1))
    }
}

fn encode(texel: &[f32; 4], alpha_scale: f32) -> [u8; 4] {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let color = |i: usize| byte(srgb_from_linear(texel[i]));
    [color(0), color(1), color(2), byte(texel[3] * alpha_scale)]
}

/// Box filter. A texel of a level below an odd size covers three texels of the level above, the
/// outer two weighted by coverage.
fn halve(
    source: &[[f32; 4]],
    (width, height): (usize, usize),
    (next_width, next_height): (usize, usize),
) -> Vec<[f32; 4]> {
    let taps = |index: usize, from: usize, to: usize| {
        let (start, end) =
            (index as f32 * from as f32 / to as f32, (index + 1) as f32 * from as f32 / to as f32);
        (start as usize..(end.ceil() as usize).min(from))
            .map(move |i| (i, (end.min(i as f32 + 1.0) - start.max(i as f32)).max(0.0)))
    };
    let mut target = Vec::with_capacity(next_width * next_height);
    for y in 0..next_height {
        for x in 0..next_width {
            let (mut shown, mut plain, mut alpha, mut total) =
                ([0.0_f32; 3], [0.0_f32; 3], 0.0_f32, 0.0_f32);
            for (row, row_weight) in taps(y, height, next_height) {
                for (column, column_weight) in taps(x, width, next_width) {
                    let (texel, weight) =
                        (source[row * width + column], row_weight * column_weight);
                    for channel in 0..3 {
                        shown[channel] += texel[channel] * texel[3] * weight;
                        plain[channel] += texel[channel] * weight;
                    }
                    alpha += texel[3] * weight;
                    total += weight;
                }
            }
            let color = if alpha > 0.0 {
                shown.map(|sum| sum / alpha)
            } else {
                plain.map(|sum| sum / total)
            };
            target.push([color[0], color[1], color[2], alpha / total]);
        }
    }
    target
}

/// Share of texels whose scaled alpha passes the cutoff.
fn coverage(level: &[[f32; 4]], cutoff: f32, scale: f32) -> f32 {
    level.iter().filter(|texel| texel[3] * scale >= cutoff).count() as f32 / level.len() as f32
}

/// The scale of alpha at which the level's coverage is closest to `target`, by bisection: coverage
/// rises with the scale.
fn alpha_scale(level: &[[f32; 4]], cutoff: f32, target: f32) -> f32 {
    let (mut low, mut high) = (0.0_f32, 4.0_f32);
    for _ in 0..16 {
        let middle = (low + high) * 0.5;
        if coverage(level, cutoff, middle) < target { low = middle } else { high = middle }
    }
    let difference = |scale: f32| (coverage(level, cutoff, scale) - target).abs();
    // A level that is already optimal keeps its alpha.
    [1.0, low, high]
        .into_iter()
        .min_by(|a, b| difference(*a).total_cmp(&difference(*b)))
        .unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
        (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .flat_map(|(x, y)| texel(x, y))
            .collect()
    }

    #[test]
    fn a_checkerboard_averages_in_linear_light() {
        let data = filled(4, 4, |x, y| if (x + y) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
        let texture = SceneTexture::from_rgba8(4, 4, data, None).unwrap();
        assert_eq!(texture.mips.len(), 3);
        // Half of the light is sRGB 188, not 128.
        assert_eq!(texture.mips[1][..4], [188, 188, 188, 255]);
        assert_eq!(texture.mips[2], [188, 188, 188, 255]);
    }

    #[test]
    fn odd_sizes_reach_one_texel_and_keep_the_mean() {
        let data = filled(5, 3, |x, _| if x == 4 { [255; 4] } else { [0, 0, 0, 255] });
        let texture = SceneTexture::from_rgba8(5, 3, data, None).unwrap();
        assert_eq!(
            (0..texture.mips.len()).map(|level| texture.mip_size(level)).collect::<Vec<_>>(),
            [(5, 3), (2, 1), (1, 1)]
        );
        let last = linear_from_srgb(f32::from(texture.mips[2][0]) / 255.0);
        assert!((last - 0.2).abs() < 0.01, "{last}");
    }

    #[test]
    fn hidden_colors_do_not_bleed_and_coverage_is_kept() {
        // One opaque red thread in four transparent green columns.
        let data =
            filled(64, 64, |x, _| if x % 4 == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 0] });
        let texture = SceneTexture::from_rgba8(64, 64, data, Some(0.5)).unwrap();
        for level in &texture.mips[1..3] {
            assert!(
                level.chunks_exact(4).all(|texel| texel[3] == 0 || texel[1] == 0),
                "green bled"
            );
        }
        let passing = texture.mips[1].chunks_exact(4).filter(|texel| texel[3] >= 128).count();
        assert!(passing > 0, "the threads vanished");
    }

    #[test]
    fn samples_blend_neighbours_in_linear_light_and_repeat() {
        let data = filled(4, 2, |x, y| {
            if y == 1 {
                [0, 0, 0, 0]
            } else {
                [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [188; 4]][x as usize]
            }
        });
        let texture = SceneTexture::from_rgba8(4, 2, data, None).unwrap();
        assert_eq!(texture.sample(0.125, 0.25), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(texture.sample(0.25, 0.25), [0.5, 0.5, 0.0, 1.0]);
        assert_eq!(texture.sample(0.375, 0.5), [0.0, 0.5, 0.0, 0.5]);
        // Half a texel left of the first blends with the last; all repeats are equal.
        let edge = texture.sample(0.0, 0.25);
        assert!((edge[0] - 0.5 - linear_from_srgb(188.0 / 255.0) / 2.0).abs() < 1e-6, "{edge:?}");
        assert_eq!((texture.sample(1.0, 1.25), texture.sample(-3.0, -0.75)), (edge, edge));
        for wild in [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN, -1e-30, 0.999_999_94] {
            assert!(
                texture
                    .sample(wild, wild)
                    .into_iter()
                    .all(|value| (0.0..=1.000_001).contains(&value)),
                "{wild}"
            );
        }
    }

    #[test]
    fn wrong_sizes_are_refused() {
        assert_eq!(SceneTexture::from_rgba8(0, 4, vec![], None), None);
        assert_eq!(SceneTexture::from_rgba8(2, 2, vec![0; 15], None), None);
        assert_eq!(SceneTexture::from_rgba8(u32::MAX, u32::MAX, vec![], None), None);
    }
}

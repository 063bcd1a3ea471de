//! A texture as a shader reads it: texels, filter and wrap.

use std::sync::LazyLock;

use glam::Vec2;
use serde::{Deserialize, Serialize};

use crate::color::linear_from_srgb;

/// Linear light of the 256 values of an sRGB texel's channel.
static DECODED: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|value| linear_from_srgb(value as f32 / 255.0)));

/// Texels, row by row from the top, each (red, green, blue, alpha).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Texels {
    /// Colour is sRGB, alpha is linear.
    Srgb(Vec<[u8; 4]>),
    /// All channels are linear.
    Linear(Vec<[u8; 4]>),
    /// All channels are linear; of any range.
    Float(Vec<[f32; 4]>),
}

impl Texels {
    fn len(&self) -> usize {
        match self {
            Self::Srgb(texels) | Self::Linear(texels) => texels.len(),
            Self::Float(texels) => texels.len(),
        }
    }

    /// In linear light; `index` must be in range.
    fn get(&self, index: usize) -> [f32; 4] {
        let unit = |value: u8| f32::from(value) / 255.0;
        match self {
            Self::Srgb(texels) => {
                let [red, green, blue, alpha] = texels[index];
                let [red, green, blue] = [red, green, blue].map(|value| DECODED[value as usize]);
                [red, green, blue, unit(alpha)]
            }
            Self::Linear(texels) => texels[index].map(unit),
            Self::Float(texels) => texels[index],
        }
    }
}

/// What lies beyond a texture's edges, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// The texture mirrored, in turns.
    Mirror,
    /// The texel at the edge.
    Clamp,
}

/// How a texture is magnified.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Filter {
    /// Bilinear, in linear light.
    #[default]
    Linear,
    /// The nearest texel.
    Nearest,
}

/// A texture and its sampler. Minified like magnified: a path tracer filters by its samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneTexture {
    /// Texels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width` × `height` texels.
    pub texels: Texels,
    /// Along u and v.
    pub wrap: [Wrap; 2],
    /// Filter.
    pub filter: Filter,
}

impl SceneTexture {
    /// Whether there is a texel at least, and as many as the size says.
    pub fn is_complete(&self) -> bool {
        let count = u64::from(self.width) * u64::from(self.height);
        count > 0 && self.texels.len() as u64 == count
    }

    /// Colour in linear light and alpha at a texture coordinate: (0, 0) is the upper left corner.
    /// A coordinate that is not finite counts as 0. The texture must be
    /// [complete](Self::is_complete).
    pub fn sample(&self, uv: Vec2) -> [f32; 4] {
        let axis = |axis: usize, size: u32| {
            self.wrap[axis].texels(uv[axis], size, self.filter == Filter::Nearest)
        };
        let ((columns, right), (rows, down)) = (axis(0, self.width), axis(1, self.height));
        let mut sum = [0.0; 4];
        for (row, row_weight) in rows.into_iter().zip([1.0 - down, down]) {
            for (column, column_weight) in columns.into_iter().zip([1.0 - right, right]) {
                let weight = row_weight * column_weight;
                // A texel without weight may be infinite.
                if weight > 0.0 {
                    let texel = self.texels.get(row * self.width as usize + column);
                    (0..4).for_each(|channel| sum[channel] += texel[channel] * weight);
                }
            }
        }
        sum
    }

    /// Mean of all texels.
    pub(crate) fn mean(&self) -> [f64; 4] {
        let count = self.texels.len();
        let mut sum = [0.0; 4];
        for texel in (0..count).map(|index| self.texels.get(index)) {
            (0..4).for_each(|channel| sum[channel] += f64::from(texel[channel]));
        }
        sum.map(|sum| sum / count.max(1) as f64)
    }
}

impl Wrap {
    /// The two texels on either side of a coordinate, and the weight of the second; texel centres
    /// are at half-integers.
    fn texels(self, coordinate: f32, size: u32, nearest: bool) -> ([usize; 2], f32) {
        let coordinate = if coordinate.is_finite() { f64::from(coordinate) } else { 0.0 };
        // One period, so that positions are exact enough.
        let coordinate = match self {
            Self::Repeat => coordinate.rem_euclid(1.0),
            Self::Mirror => coordinate.rem_euclid(2.0),
            Self::Clamp => coordinate.clamp(-1.0, 2.0),
        };
        let size = i64::from(size);
        let texel = |index: i64| match self {
            Self::Repeat => index.rem_euclid(size) as usize,
            Self::Mirror => {
                let index = index.rem_euclid(2 * size);
                index.min(2 * size - 1 - index) as usize
            }
            Self::Clamp => index.clamp(0, size - 1) as usize,
        };
        let position = coordinate * size as f64;
        if nearest {
            return ([texel(position.floor() as i64); 2], 0.0);
        }
        let first = (position - 0.5).floor();
        let weight = (position - 0.5 - first) as f32;
        ([texel(first as i64), texel(first as i64 + 1)], weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(texels: Texels, wrap: Wrap, filter: Filter) -> SceneTexture {
        let width = texels.len() as u32;
        SceneTexture { width, height: 1, texels, wrap: [wrap; 2], filter }
    }

    #[test]
    fn samples_blend_neighbours_in_linear_light_and_repeat() {
        let first = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [188; 4]];
        let texels = Texels::Srgb(first.into_iter().chain([[0; 4]; 4]).collect());
        let texture =
            SceneTexture { width: 4, height: 2, ..row(texels, Wrap::Repeat, Filter::Linear) };
        let at = |u, v| texture.sample(Vec2::new(u, v));
        assert_eq!(at(0.125, 0.25), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(0.25, 0.25), [0.5, 0.5, 0.0, 1.0]);
        assert_eq!(at(0.375, 0.5), [0.0, 0.5, 0.0, 0.5]);
        // Half a texel left of the first blends with the last; all repeats are equal.
        let edge = at(0.0, 0.25);
        assert!((edge[0] - 0.5 - linear_from_srgb(188.0 / 255.0) / 2.0).abs() < 1e-6, "{edge:?}");
        assert_eq!((at(1.0, 1.25), at(-3.0, -0.75)), (edge, edge));
    }

    #[test]
    fn every_wrap_continues_the_texture_in_its_way() {
        let texels = || Texels::Float([1.0, 2.0, 3.0, 4.0].map(|value| [value; 4]).to_vec());
        let values = |wrap| {
            let texture = row(texels(), wrap, Filter::Nearest);
            let at = |position: i32| texture.sample(Vec2::new((position as f32 + 0.5) / 4.0, 0.5));
            (-6..10).map(|position| at(position)[0]).collect::<Vec<_>>()
        };
        let repeat = [3., 4., 1., 2., 3., 4., 1., 2., 3., 4., 1., 2., 3., 4., 1., 2.];
        let mirror = [3., 4., 4., 3., 2., 1., 1., 2., 3., 4., 4., 3., 2., 1., 1., 2.];
        let clamp = [1., 1., 1., 1., 1., 1., 1., 2., 3., 4., 4., 4., 4., 4., 4., 4.];
        for (wrap, expected) in
            [(Wrap::Repeat, repeat), (Wrap::Mirror, mirror), (Wrap::Clamp, clamp)]
        {
            assert_eq!(values(wrap), expected, "{wrap:?}");
        }
        // At a mirrored or clamped edge there is nothing to blend with.
        for (wrap, edge) in [(Wrap::Repeat, 2.5), (Wrap::Mirror, 1.0), (Wrap::Clamp, 1.0)] {
            assert_eq!(row(texels(), wrap, Filter::Linear).sample(Vec2::ZERO)[0], edge, "{wrap:?}");
        }
    }

    #[test]
    fn wild_coordinates_stay_in_the_texture() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Linear, Filter::Nearest] {
                let texture = row(Texels::Linear(vec![[255; 4], [0; 4], [7; 4]]), wrap, filter);
                for wild in [f32::NAN, f32::INFINITY, f32::MAX, f32::MIN, -1e-30, 0.999_999_94] {
                    let sample = texture.sample(Vec2::splat(wild));
                    assert!(sample.iter().all(|value| (0.0..=1.0).contains(value)), "{wild}");
                }
            }
        }
    }

    #[test]
    fn encodings_and_wrong_sizes_are_told_apart() {
        let mean = |texels| row(texels, Wrap::Repeat, Filter::Linear).mean();
        let grey = f64::from(linear_from_srgb(128.0 / 255.0));
        assert!((mean(Texels::Srgb(vec![[128; 4]]))[0] - grey).abs() < 1e-6);
        assert!((mean(Texels::Linear(vec![[128; 4], [0; 4]]))[0] - 64.0 / 255.0).abs() < 1e-6);
        let complete = row(Texels::Linear(vec![[0; 4]; 4]), Wrap::Repeat, Filter::Linear);
        assert!(complete.is_complete());
        for (width, height) in [(0, 4), (4, 0), (3, 1), (u32::MAX, u32::MAX)] {
            assert!(!SceneTexture { width, height, ..complete.clone() }.is_complete());
        }
    }
}

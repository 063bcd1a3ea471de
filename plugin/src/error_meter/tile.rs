//! The part of an image that is measured.

use bevy::math::{UVec2, Vec2};

/// Pixels of a window of SSIM along a side: a part must be wider.
pub(super) const WINDOW: u32 = 11;
/// Most windows along a side of a part; partial sums of more would not fit their buffer.
const MAX_SIDE: u32 = 4096;

/// A part of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    /// Size of the whole image, pixels.
    pub full: UVec2,
    /// Upper left corner, pixels.
    pub offset: UVec2,
    /// Width and height, pixels; as long and as wide as the whole image's in proportion.
    pub size: UVec2,
}

impl Tile {
    /// The part number `count` of an image: at most `share` of its width and height, each time
    /// elsewhere. `None` where the image is too small for a window of SSIM, or too large.
    pub(super) fn new(full: UVec2, share: f32, count: u32) -> Option<Self> {
        let common = greatest_common_divisor(full.x, full.y);
        if common == 0 {
            return None;
        }
        // The projection of a part has the whole image's aspect ratio only where both are whole
        // multiples of this.
        let step = full / common;
        let share = if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) };
        let least = step.as_vec2().recip().max_element() * WINDOW as f32;
        let steps = ((share * common as f32) as u32).max(least.ceil() as u32).clamp(1, common);
        let size = step * steps;
        if size.min_element() < WINDOW || size.max_element() > MAX_SIDE {
            return None;
        }
        let place = (place(count) * (full - size + 1).as_vec2()).as_uvec2();
        Some(Self { full, offset: place.min(full - size), size })
    }
}

/// Points that fill the unit square evenly (Roberts 2018, the R2 sequence).
fn place(count: u32) -> Vec2 {
    let along = |step: f64| (0.5 + step * f64::from(count)).fract() as f32;
    Vec2::new(along(0.754_877_666_246_693), along(0.569_840_290_998_053))
}

fn greatest_common_divisor(mut a: u32, mut b: u32) -> u32 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_lie_inside_the_image_and_have_its_aspect_ratio() {
        for full in [(1920, 1080), (1280, 800), (1366, 768), (96, 54), (641, 359), (11, 4000)] {
            let full = UVec2::from(full);
            for share in [f32::NAN, f32::NEG_INFINITY, 0.0, 0.1, 0.5, 1.0, 7.0] {
                for count in [0, 1, 2, 1000, u32::MAX] {
                    let tile = Tile::new(full, share, count).expect("a part");
                    assert!((tile.offset + tile.size).cmple(full).all(), "{tile:?}");
                    assert!(tile.size.min_element() >= WINDOW, "{tile:?}");
                    assert_eq!(tile.size.x * full.y, tile.size.y * full.x, "{tile:?}");
                }
            }
        }
        assert_eq!(
            Tile::new(UVec2::new(1920, 1080), 0.5, 0).map(|tile| tile.size),
            Some(UVec2::new(960, 540))
        );
        for odd in [UVec2::ZERO, UVec2::new(10, 100), UVec2::new(1, 0), UVec2::splat(u32::MAX)] {
            assert_eq!(Tile::new(odd, 1.0, 0), None, "{odd}");
        }
    }

    #[test]
    fn parts_cover_the_image_in_time() {
        let full = UVec2::new(160, 90);
        let mut seen = vec![0; 160 * 90];
        for count in 0..64 {
            let tile = Tile::new(full, 0.5, count).expect("a part");
            for y in tile.offset.y..tile.offset.y + tile.size.y {
                for x in tile.offset.x..tile.offset.x + tile.size.x {
                    seen[(y * 160 + x) as usize] += 1;
                }
            }
        }
        let rarely = seen.iter().filter(|count| **count == 0).count();
        assert!(rarely < seen.len() / 20, "{rarely} of {} pixels were never seen", seen.len());
    }
}

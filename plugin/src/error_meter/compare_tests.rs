//! Tests of the part that is compared, and of the sums of a comparison.

use super::*;

#[test]
fn sums_of_another_comparison_are_no_error() {
    let tile = Tile { full: UVec2::splat(40), offset: UVec2::ZERO, size: UVec2::new(20, 19) };
    assert_eq!((groups(&tile), bytes(&tile)), (UVec2::splat(2), 32));
    let sums = |values: [[f32; 2]; 4]| bytemuck::cast_slice(&values).to_vec();
    let right = sums([[0.9, 64.0], [0.0, 16.0], [0.0, 8.0], [0.0, 2.0]]);
    assert!((error(&tile, &right).unwrap() - 0.01).abs() < 1e-6);
    assert_eq!(error(&tile, &sums([[0.0; 2]; 4])), None, "nothing was written");
    assert_eq!(error(&tile, &sums([[f32::NAN, 90.0], [0.0; 2], [0.0; 2], [0.0; 2]])), None);
    assert_eq!(error(&tile, &[]), None);
    assert_eq!(error(&tile, &sums([[-1e-6, 90.0], [0.0; 2], [0.0; 2], [0.0; 2]])), Some(0.0));
}

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

//! SSIM against scikit-image's numbers, and at the extremes.

use serde::Deserialize;

use super::{Reference, SsimError, error};
use crate::metrics::Picture;

#[derive(Deserialize)]
struct Fixtures {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    first: String,
    second: String,
    width: u32,
    height: u32,
    error: f64,
}

/// The same as `noise` in `ssim_fixtures.py`.
fn noise(x: u32, y: u32, seed: u32) -> i32 {
    let mut value = x
        .wrapping_mul(0x9E37_79B1)
        .wrapping_add(y.wrapping_mul(0x85EB_CA77))
        .wrapping_add(seed.wrapping_mul(0xC2B2_AE3D));
    value ^= value >> 15;
    value = value.wrapping_mul(0x2C1B_3C6D);
    value ^= value >> 13;
    (value >> 8 & 255) as i32
}

/// The same as `pixel` in `ssim_fixtures.py`.
fn pixel(name: &str, x: u32, y: u32, (width, height): (u32, u32)) -> [i32; 3] {
    let base = |name: &str, x: u32, y: u32| pixel(name, x, y, (width, height));
    match name {
        "gradient" => {
            [x * 255 / (width - 1), y * 255 / (height - 1), (x + y) * 255 / (width + height - 2)]
                .map(|v| v as i32)
        }
        "texture" => {
            let gradient = base("gradient", x, y);
            std::array::from_fn(|c| {
                (gradient[c] / 2 + noise(x / 3, y / 2, c as u32) / 2).clamp(0, 255)
            })
        }
        "dark" => [10 + (x * 50 / (width - 1)) as i32; 3],
        "static" => std::array::from_fn(|c| noise(x, y, c as u32)),
        "black" => [0; 3],
        "white" => [255; 3],
        _ => {
            let (name, change) = name.split_once('+').unwrap();
            let value = base(name, x, y);
            match change {
                "noise1" | "noise8" => {
                    let strength: i32 = change[5..].parse().unwrap();
                    std::array::from_fn(|c| {
                        (value[c] + noise(x, y, 7 + c as u32) * (2 * strength + 1) / 256 - strength)
                            .clamp(0, 255)
                    })
                }
                "inverted" => value.map(|v| 255 - v),
                "shifted" => base(name, x.saturating_sub(2), y.saturating_sub(1)),
                "blurred" => {
                    let mut total = [0; 3];
                    for (dx, dy) in (0..9).map(|i| (i % 3, i / 3)) {
                        let near = base(
                            name,
                            (x + dx).saturating_sub(1).min(width - 1),
                            (y + dy).saturating_sub(1).min(height - 1),
                        );
                        total = std::array::from_fn(|c| total[c] + near[c]);
                    }
                    total.map(|v| v / 9)
                }
                "brighter" => value.map(|v| (v + 20).clamp(0, 255)),
                "dot" if (x, y) == (width / 2, height / 2) => [255; 3],
                "dot" => value,
                _ => panic!("no change is called {change}"),
            }
        }
    }
}

fn build(name: &str, width: u32, height: u32) -> Picture {
    Picture::from_fn(width, height, |x, y| {
        pixel(name, x, y, (width, height)).map(|v| u8::try_from(v).unwrap())
    })
}

fn plain(width: u32, height: u32, grey: u8) -> Picture {
    Picture::from_fn(width, height, |_, _| [grey; 3])
}

#[test]
fn agrees_with_scikit_image() {
    let fixtures: Fixtures = serde_json::from_str(include_str!("ssim_fixtures.json")).unwrap();
    assert!(fixtures.cases.len() >= 90);
    let mut worst = (0.0, String::new());
    for case in &fixtures.cases {
        let (first, second) = (
            build(&case.first, case.width, case.height),
            build(&case.second, case.width, case.height),
        );
        let ours = error(&first, &second).unwrap();
        let off = (ours - case.error).abs();
        if off >= worst.0 {
            worst = (
                off,
                format!(
                    "{} / {} at {}×{}: {ours} is not {}",
                    case.first, case.second, case.width, case.height, case.error
                ),
            );
        }
    }
    assert!(worst.0 < 1e-6, "off by {}: {}", worst.0, worst.1);
}

#[test]
fn negative_similarity_is_kept() {
    assert!(error(&build("static", 64, 48), &build("static+inverted", 64, 48)).unwrap() > 1.5);
}

#[test]
fn equal_images_have_no_error_at_all() {
    for (width, height) in
        [(1, 1), (1, 300), (10, 10), (10, 64), (11, 11), (64, 10), (33, 17), (160, 90)]
    {
        for name in ["static", "black", "white"] {
            let picture = build(name, width, height);
            assert_eq!(error(&picture, &picture), Ok(0.0), "{name} at {width}×{height}");
        }
    }
}

#[test]
fn is_symmetric_and_finite_and_within_range() {
    for (width, height) in [(1, 1), (2, 9), (10, 11), (11, 11), (40, 30)] {
        let pictures: Vec<_> = ["static", "black", "white"]
            .into_iter()
            .map(|name| build(name, width, height))
            .chain([plain(width, height, 128)])
            .collect();
        for a in &pictures {
            for b in &pictures {
                let ab = error(a, b).unwrap();
                assert!((0.0..=2.0).contains(&ab), "{ab}");
                assert!((ab - error(b, a).unwrap()).abs() < 1e-6);
                assert_eq!(ab == 0.0, a == b);
            }
        }
    }
}

#[test]
fn black_against_white_is_as_different_as_means_allow() {
    // Variances are 0, so that only the luminance term is left: C1 / (255² + C1).
    let expected = 1.0 - 6.5025 / (255.0 * 255.0 + 6.5025);
    for (width, height) in [(1, 1), (5, 90), (11, 11), (320, 180)] {
        let off = error(&plain(width, height, 0), &plain(width, height, 255)).unwrap() - expected;
        assert!(off.abs() < 1e-6, "{off}");
    }
}

#[test]
fn one_pixel_shows_wherever_a_window_reaches_it() {
    let (width, height) = (40, 30);
    let before = build("gradient", width, height);
    for (x, y) in [(0, 0), (20, 15), (39, 29), (5, 5), (39, 0)] {
        let mut after = before.clone();
        after.rgb[(y * width + x) as usize] = [255, 0, 255];
        assert!(error(&before, &after).unwrap() > 0.0, "{x}, {y}");
    }
}

#[test]
fn a_small_image_is_one_window() {
    // Grey levels 0 and 255 against 255 and 0: means equal, variances 127.5², covariance −127.5².
    let halves =
        |left: u8, right: u8| Picture::from_fn(2, 1, |x, _| [if x == 0 { left } else { right }; 3]);
    let variance = 127.5 * 127.5;
    let expected = 1.0 - (58.5225 - 2.0 * variance) / (58.5225 + 2.0 * variance);
    assert!((error(&halves(0, 255), &halves(255, 0)).unwrap() - expected).abs() < 1e-5);
}

#[test]
fn incomparable_images_are_refused() {
    let picture = plain(20, 20, 9);
    let mismatch = SsimError::Size { reference: (20, 20), picture: (20, 21) };
    assert_eq!(error(&picture, &plain(20, 21, 9)), Err(mismatch));
    assert_eq!(mismatch.to_string(), "the reference has 20×20 pixels, the image 20×21");
    assert_eq!(error(&Picture::default(), &Picture::default()), Err(SsimError::Empty));
    let torn = Picture { rgb: vec![[0; 3]; 3], ..picture.clone() };
    assert_eq!(
        error(&picture, &torn),
        Err(SsimError::Malformed { width: 20, height: 20, pixels: 3 })
    );
    assert!(Reference::new(&torn).is_err());
}

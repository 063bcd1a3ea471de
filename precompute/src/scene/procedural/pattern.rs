//! Procedural textures: cut stone, and pierced cloth. From seeded integer noise, so that they are
//! the same on every machine.

use crate::scene::SceneTexture;
use crate::scene::texture::srgb_from_linear;

/// A number in [0, 1) from three integers (the finaliser of `MurmurHash3`).
fn hash(x: u32, y: u32, seed: u32) -> f32 {
    let mut bits =
        x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    bits = (bits ^ (bits >> 16)).wrapping_mul(0x85eb_ca6b);
    bits = (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35);
    ((bits ^ (bits >> 16)) >> 8) as f32 / 16_777_216.0
}

/// Smooth noise in [0, 1] that repeats after `period` cells; `x` and `y` are in repeats, in [0, 1).
fn noise(x: f32, y: f32, period: u32, seed: u32) -> f32 {
    let (x, y) = (x * period as f32, y * period as f32);
    let (column, row) = (x as u32, y as u32);
    let smooth = |t: f32| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x.fract()), smooth(y.fract()));
    let corner = |i: u32, j: u32| hash((column + i) % period, (row + j) % period, seed);
    let (low, high) =
        (corner(0, 0) * (1.0 - s) + corner(1, 0) * s, corner(0, 1) * (1.0 - s) + corner(1, 1) * s);
    low * (1.0 - t) + high * t
}

/// Several octaves of [`noise`], in [0, 1].
fn clouds(x: f32, y: f32, period: u32, octaves: u32, seed: u32) -> f32 {
    let octave = |i: u32| noise(x, y, period << i, seed + i) * 0.5_f32.powi(i as i32 + 1);
    (0..octaves).map(octave).sum::<f32>() / (1.0 - 0.5_f32.powi(octaves as i32))
}

fn paint(
    width: u32,
    height: u32,
    cutoff: Option<f32>,
    texel: impl Fn(f32, f32) -> [f32; 4],
) -> Option<SceneTexture> {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    let mut data = Vec::with_capacity((width * height * 4) as usize);
    for row in 0..height {
        for column in 0..width {
            let [red, green, blue, alpha] =
                texel((column as f32 + 0.5) / width as f32, (row as f32 + 0.5) / height as f32);
            data.extend(
                [red, green, blue].map(|value| byte(srgb_from_linear(value.clamp(0.0, 1.0)))),
            );
            data.push(byte(alpha));
        }
    }
    SceneTexture::from_rgba8(width, height, data, cutoff)
}

/// Ashlar of four by four blocks in a running bond, with dark joints, chisel marks, veins and
/// pores: detail at every scale down to a texel, so that filtering has a visible effect.
pub(super) fn stone() -> Option<SceneTexture> {
    const BLOCKS: f32 = 4.0;
    paint(512, 512, None, |x, y| {
        let row = (y * BLOCKS) as u32;
        let shifted = (x * BLOCKS + 0.5 * (row % 2) as f32) % BLOCKS;
        let column = shifted as u32;
        // Distance to the block's edge in blocks, roughened.
        let (u, v) = (shifted.fract(), (y * BLOCKS).fract());
        let rough = (noise(x, y, 64, 11) - 0.5) * 0.02;
        let edge = u.min(1.0 - u).min(v).min(1.0 - v) + rough;
        let joint = ((edge - 0.014) / 0.016).clamp(0.0, 1.0);
        let bevel = ((edge - 0.02) / 0.05).clamp(0.0, 1.0);
        let block = hash(column, row, 3);
        let marks = noise((x + 0.35 * y * (1.0 + (block * 3.0).floor())) % 1.0, y, 128, 21);
        let vein = (clouds(x, y, 6, 5, 31) - 0.5).abs();
        let vein = 1.0 - (1.0 - (vein / 0.025).min(1.0)) * 0.22;
        let pores = if noise(x, y, 170, 41) > 0.83 { 0.7 } else { 1.0 };
        let body = (0.66 + 0.22 * block)
            * (0.8 + 0.3 * clouds(x, y, 8, 5, 51))
            * (0.88 + 0.2 * marks)
            * vein
            * pores;
        let light = 0.16 + (body - 0.16) * joint * (0.82 + 0.18 * bevel);
        // Blocks vary between warm and cool.
        let warmth = (hash(column, row, 5) - 0.5) * 0.09;
        [light * (1.0 + warmth), light, light * (1.0 - warmth), 1.0]
    })
}

/// Cloth of one length from hem to hem: a weave that shows its threads, two embroidered bands, rows
/// of pierced diamonds, and a fringe at its foot (v = 1). Alpha is 1 or 0.
pub(super) fn cloth(cutoff: f32) -> Option<SceneTexture> {
    paint(256, 512, Some(cutoff), |x, y| {
        let (warp, weft) = (x * 64.0, y * 128.0);
        let over = (warp as u32 + weft as u32).is_multiple_of(2);
        let round = |t: f32| 1.0 - (2.0 * t.fract() - 1.0).powi(2);
        let thread = if over { round(warp) } else { round(weft) };
        let weave = 0.55 + 0.4 * thread + 0.12 * (hash(warp as u32, weft as u32, 7) - 0.5);
        let fold = 0.9 + 0.1 * clouds(x, y, 4, 3, 17);
        let within = |from: f32, to: f32| y >= from && y < to;
        let diamond = |across: f32, from: f32, to: f32, size: f32| {
            let (u, v) = ((x * across).fract() - 0.5, (y - from) / (to - from) - 0.5);
            within(from, to) && u.abs() + v.abs() < size
        };
        let pierced = diamond(8.0, 0.12, 0.18, 0.36)
            || diamond(4.0, 0.66, 0.78, 0.34)
            || diamond(8.0, 0.80, 0.85, 0.36);
        let fringe = y > 0.94 && (x * 32.0 + 0.3 * hash((x * 32.0) as u32, 0, 9)).fract() > 0.55;
        let gold =
            within(0.09, 0.105) || within(0.195, 0.21) || within(0.63, 0.65) || within(0.87, 0.895);
        let alpha = if pierced || fringe { 0.0 } else { 1.0 };
        let light = weave * fold;
        let tint = if gold { [1.0, 1.0, 0.85] } else { [0.78, 0.78, 0.78] };
        [tint[0] * light, tint[1] * light, tint[2] * light, alpha]
    })
}

// Structural similarity of single windows: Wang, Bovik, Sheikh, Simoncelli 2004.
#define_import_path bevy_frugal_gi::error_meter::ssim

// Side of a window, pixels.
const WINDOW: u32 = 11u;
// Standard deviation of its weights, pixels.
const SIGMA: f32 = 1.5;
// (K1 L)^2 and (K2 L)^2 with L = 255.
const C1: f32 = 6.5025;
const C2: f32 = 58.5225;

// Weight of a pixel `offset` from a window's corner, not normalised.
fn weight(offset: vec2<u32>) -> f32 {
    let from_middle = vec2<f32>(offset) - 0.5 * f32(WINDOW - 1u);
    return exp(-dot(from_middle, from_middle) / (2.0 * SIGMA * SIGMA));
}

// Weighted sums of a window: of the weights, both values, their squares, and their product. Values
// are relative to a base, since a variance is the small difference of two large numbers.
struct Sums {
    weight: f32,
    a: f32,
    b: f32,
    aa: f32,
    bb: f32,
    ab: f32,
}

fn add(sums: Sums, weight: f32, a: f32, b: f32) -> Sums {
    return Sums(
        sums.weight + weight,
        sums.a + weight * a,
        sums.b + weight * b,
        sums.aa + weight * a * a,
        sums.bb + weight * b * b,
        sums.ab + weight * a * b,
    );
}

fn similarity(sums: Sums, base: f32) -> f32 {
    let a = sums.a / sums.weight;
    let b = sums.b / sums.weight;
    let variance_a = max(sums.aa / sums.weight - a * a, 0.0);
    let variance_b = max(sums.bb / sums.weight - b * b, 0.0);
    let covariance = sums.ab / sums.weight - a * b;
    let mean_a = a + base;
    let mean_b = b + base;
    return (2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2)
        / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2));
}

// The error of a part of a camera's image against the best settings: 1 - SSIM, summed over windows
// (structural similarity: Wang, Bovik, Sheikh, Simoncelli 2004).

#import bevy_frugal_gi::resolution::upscale::catmull_rom

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

// Windows along a side of a workgroup, and the pixels that they cover.
const GROUP: u32 = 8u;
const PIXELS: u32 = GROUP + WINDOW - 1u;

// The camera's image, before it is upscaled where it is rendered at a smaller size.
@group(0) @binding(0) var shown: texture_2d<f32>;
@group(0) @binding(1) var shown_sampler: sampler;
// The part at the best settings.
@group(0) @binding(2) var best: texture_2d<f32>;

struct Part {
    // Upper left corner of the camera's image in `shown`, texels.
    origin: vec2<f32>,
    // Texels of `shown` per pixel.
    scale: vec2<f32>,
    // Upper left corner of the part, pixels.
    offset: vec2<f32>,
    // Width and height of the part, pixels.
    size: vec2<u32>,
}
@group(0) @binding(3) var<uniform> part: Part;

// For each workgroup the sum over its windows, and their number.
@group(0) @binding(4) var<storage, read_write> sums: array<vec2<f32>>;

var<workgroup> luma_shown: array<f32, PIXELS * PIXELS>;
var<workgroup> luma_best: array<f32, PIXELS * PIXELS>;
var<workgroup> errors: array<vec2<f32>, GROUP * GROUP>;

// Luma, 0 to 255, of the eight-bit values on screen. NaN is black.
fn luma(linear: vec3<f32>) -> f32 {
    let light = clamp(select(vec3(0.0), linear, linear > vec3(0.0)), vec3(0.0), vec3(1.0));
    let low = 12.92 * light;
    let high = 1.055 * pow(light, vec3(1.0 / 2.4)) - 0.055;
    let encoded = select(high, low, light <= vec3(0.0031308));
    return dot(round(255.0 * encoded), vec3(0.2126, 0.7152, 0.0722));
}

@compute @workgroup_size(8, 8, 1)
fn compare(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
    let first = group.xy * GROUP;
    for (var i = index; i < PIXELS * PIXELS; i += GROUP * GROUP) {
        let pixel = min(first + vec2(i % PIXELS, i / PIXELS), part.size - 1u);
        let place = part.origin + (part.offset + vec2<f32>(pixel) + 0.5) * part.scale;
        luma_shown[i] = luma(catmull_rom(shown, shown_sampler, place).rgb);
        luma_best[i] = luma(textureLoad(best, pixel, 0).rgb);
    }
    workgroupBarrier();
    var error = vec2(0.0);
    if all(first + local.xy + WINDOW <= part.size) {
        let corner = local.y * PIXELS + local.x;
        let base = luma_best[corner];
        var window = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (var y = 0u; y < WINDOW; y++) {
            for (var x = 0u; x < WINDOW; x++) {
                let at = corner + y * PIXELS + x;
                window =
                    add(window, weight(vec2(x, y)), luma_best[at] - base, luma_shown[at] - base);
            }
        }
        error = vec2(1.0 - similarity(window, base), 1.0);
    }
    errors[index] = error;
    workgroupBarrier();
    if index == 0u {
        var sum = vec2(0.0);
        for (var i = 0u; i < GROUP * GROUP; i++) {
            sum += errors[i];
        }
        sums[group.y * groups.x + group.x] = sum;
    }
}

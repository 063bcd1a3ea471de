// Noise of low-resolution pixels, hashes, and luminance.
#define_import_path bevy_frugal_gi::gi::view::noise

/// Rec. 709, linear RGB.
fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

/// Interleaved gradient noise (Jimenez 2014), 0 to 1: the pixels of a small filter have every value
/// about once. Over frames 0, 1, 2… a pixel's values spread by the golden ratio.
fn pixel_noise(cell: vec2<u32>, frame: f32) -> f32 {
    return fract(52.9829189 * fract(dot(vec2<f32>(cell), vec2(0.06711056, 0.00583715))) + frame * 0.618034);
}

/// A hash.
fn mixed(value: u32) -> u32 {
    // A round of PCG: Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

/// A number in 0 to 1.
fn random(seed: u32) -> f32 {
    return f32(mixed(seed) >> 8u) * 5.9604645e-8;
}

// The sky as light from a fixed number of directions.
#define_import_path bevy_frugal_gi::gi::sky::sky

/// Light from one direction: of a stratum of the sky, or of a sample, which represents more.
struct SkyLight {
    /// World space, unit length, towards the light.
    direction: vec3<f32>,
    padding_1: f32,
    /// π times the illuminance of a surface that faces it, lux.
    light: vec3<f32>,
    padding_2: f32,
}

/// Strata along each side of the square onto which the sphere is mapped.
const SKY_SIDE: u32 = 32u;
/// Number of strata.
const SKY_STRATA: u32 = SKY_SIDE * SKY_SIDE;
/// Neighbouring strata that share one ray.
const SKY_STRATA_PER_RAY: u32 = 4u;
/// Samples from one set to the next: the most samples of a pixel.
const SKY_STRIDE: u32 = 32u;

/// Position of a stratum on the square: in Morton order, so that strata with near indices are near
/// each other in the sky.
fn stratum_position(index: u32) -> vec2<u32> {
    var position = vec2(0u);
    for (var bit = 0u; bit < 5u; bit++) {
        position |= vec2((index >> (2u * bit)) & 1u, (index >> (2u * bit + 1u)) & 1u) << vec2(bit);
    }
    return position;
}

/// The direction at a point of the unit square, by an equal-area mapping: Clarberg 2008, "Fast
/// Equal-Area Mapping of the (Hemi)Sphere using SIMD". The square's middle is straight up, its
/// corners are straight down.
fn sky_direction(uv: vec2<f32>) -> vec3<f32> {
    let from_middle = uv * 2.0 - 1.0;
    let folded = abs(from_middle);
    // Above 0 in the upper hemisphere.
    let above = 1.0 - folded.x - folded.y;
    let radius = 1.0 - abs(above);
    let angle = select((folded.y - folded.x) / max(radius, 1e-20) + 1.0, 1.0, radius < 1e-6) * 0.78539816;
    let around = radius * sqrt(max(2.0 - radius * radius, 0.0));
    let flat = around * vec2(cos(angle), sin(angle)) * select(vec2(-1.0), vec2(1.0), from_middle >= vec2(0.0));
    return vec3(flat.x, (1.0 - radius * radius) * select(-1.0, 1.0, above >= 0.0), flat.y);
}

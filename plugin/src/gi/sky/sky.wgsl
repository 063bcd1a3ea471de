// The sky as light from a fixed number of directions.
#define_import_path bevy_frugal_gi::gi::sky::sky

/// Light from one direction: of a part of the sky, or of a sample that stands for more.
struct SkyLight {
    /// World space, unit length: where it comes from.
    direction: vec3<f32>,
    padding_1: f32,
    /// π times the illuminance of a surface that faces it, lux.
    light: vec3<f32>,
    padding_2: f32,
}

/// How a camera's samples of the sky are shared out among its pixels. In a storage buffer because
/// the count decides about loops: software Vulkan drivers compile a shader anew for each value that
/// control flow takes from a uniform.
struct SkyPlan {
    /// Samples that each pixel evaluates.
    samples: u32,
    /// Sets of them, each of which stands for the whole sky.
    sets: u32,
}

/// Parts along each side of the square that the sphere is laid out on.
const SKY_SIDE: u32 = 32u;
/// All of them.
const SKY_STRATA: u32 = SKY_SIDE * SKY_SIDE;
/// Parts that one ray answers for: four, which are next to each other.
const SKY_STRATA_PER_RAY: u32 = 4u;
/// From one set of samples to the next: most samples of a pixel.
const SKY_STRIDE: u32 = 32u;

/// Place of a part on the square: Morton order, so that parts with near indices are near each other
/// in the sky.
fn stratum_position(index: u32) -> vec2<u32> {
    var place = vec2(0u);
    for (var bit = 0u; bit < 5u; bit++) {
        place |= vec2((index >> (2u * bit)) & 1u, (index >> (2u * bit + 1u)) & 1u) << vec2(bit);
    }
    return place;
}

/// The direction at a place of the unit square, equal areas of which are equal solid angles:
/// Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD". The square's middle is
/// straight up, its corners are straight down.
fn sky_direction(place: vec2<f32>) -> vec3<f32> {
    let from_middle = place * 2.0 - 1.0;
    let folded = abs(from_middle);
    // Above 0 in the upper half of the sky.
    let above = 1.0 - folded.x - folded.y;
    let radius = 1.0 - abs(above);
    let angle = select((folded.y - folded.x) / max(radius, 1e-20) + 1.0, 1.0, radius < 1e-6) * 0.78539816;
    let around = radius * sqrt(max(2.0 - radius * radius, 0.0));
    let flat = around * vec2(cos(angle), sin(angle)) * select(vec2(-1.0), vec2(1.0), from_middle >= vec2(0.0));
    return vec3(flat.x, (1.0 - radius * radius) * select(-1.0, 1.0, above >= 0.0), flat.y);
}

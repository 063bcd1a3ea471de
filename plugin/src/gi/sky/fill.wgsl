// Integrates an environment map over strata of equal solid angle: one thread per stratum.
//
// A stratum's direction is the mean weighted by luminance, so that a small sun keeps its position
// however coarse the strata are.
//
// Texels are loaded, not sampled: each stratum is a mean over many anyway, any float format works
// (many phones' GPUs do not filter 32-bit ones), and seams between faces are avoided (SwiftShader's
// are dark or bright in float formats).

#import bevy_frugal_gi::gi::view::noise::luminance
#import bevy_frugal_gi::gi::sky::sky::{SKY_SIDE, SKY_STRATA, SkyLight, sky_direction, stratum_position}

struct SkySource {
    /// Quaternion that takes world directions to the map's.
    rotation: vec4<f32>,
    /// Nits per unit of the map.
    intensity: f32,
    /// Mip level whose texels are about as large as the steps below.
    level: u32,
}

/// Faces +X, −X, +Y, −Y, +Z, −Z.
@group(0) @binding(0) var environment: texture_2d_array<f32>;
@group(0) @binding(1) var<storage, read> source: SkySource;
@group(0) @binding(2) var<storage, read_write> strata: array<SkyLight>;

/// Steps along each side of a stratum.
const STEPS: u32 = 16u;
/// Nits. Clamps the map, so that sums over it stay finite.
const MAX_RADIANCE: f32 = 1e20;

fn rotated(rotation: vec4<f32>, direction: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(rotation.xyz, direction);
    return direction + rotation.w * t + cross(rotation.xyz, t);
}

/// The cube map's texel in a direction.
fn environment_texel(ray: vec3<f32>, level: u32) -> vec3<f32> {
    let size = abs(ray);
    let is_x = size.x >= size.y && size.x >= size.z;
    let is_y = !is_x && size.y >= size.z;
    let along = select(select(ray.z, ray.y, is_y), ray.x, is_x);
    let forth = along >= 0.0;
    let x = vec2(select(ray.z, -ray.z, forth), -ray.y);
    let y = vec2(ray.x, select(-ray.z, ray.z, forth));
    let z = vec2(select(-ray.x, ray.x, forth), -ray.y);
    let uv = select(select(z, y, is_y), x, is_x) / max(abs(along), 1e-20) * 0.5 + 0.5;
    let face = select(select(4u, 2u, is_y), 0u, is_x) + select(1u, 0u, forth);
    let edge = textureDimensions(environment, level).x;
    let texel = min(vec2<u32>(clamp(uv, vec2(0.0), vec2(1.0)) * f32(edge)), vec2(edge - 1u));
    return textureLoad(environment, texel, face, level).rgb;
}

@compute @workgroup_size(64)
fn fill_sky(@builtin(global_invocation_id) id: vec3<u32>) {
    let corner = vec2<f32>(stratum_position(id.x));
    let level = min(source.level, textureNumLevels(environment) - 1u);
    var light = vec3(0.0);
    var toward = vec3(0.0);
    for (var y = 0u; y < STEPS; y++) {
        for (var x = 0u; x < STEPS; x++) {
            let point = corner + (vec2<f32>(vec2(x, y)) + 0.5) / f32(STEPS);
            let direction = sky_direction(point / f32(SKY_SIDE));
            // Cube maps are left-handed; Bevy flips z.
            let ray = rotated(source.rotation, direction) * vec3(1.0, 1.0, -1.0);
            let found = environment_texel(ray, level) * source.intensity;
            // Negative values and NaN compare false.
            let radiance = select(vec3(0.0), min(found, vec3(MAX_RADIANCE)), found >= vec3(0.0));
            light += radiance;
            // Clamped, so that the square of the sum is finite.
            toward += direction * min(luminance(radiance), 1e15);
        }
    }
    let middle = sky_direction((corner + 0.5) / f32(SKY_SIDE));
    let size = length(toward);
    var stratum: SkyLight;
    stratum.direction = select(middle, toward / max(size, 1e-18), size > 1e-18);
    // 4π sr in all.
    stratum.light = light * (3.1415927 * 12.566371 / f32(SKY_STRATA * STEPS * STEPS));
    strata[id.x] = stratum;
}

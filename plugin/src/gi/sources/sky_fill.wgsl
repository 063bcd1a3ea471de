// Reads an environment map into parts of equal solid angle: one thread per part.
//
// A part's light comes from the middle of what is bright in it, so that a small sun keeps its place however coarse the parts are.

#import bevy_frugal_gi::gi::luminance::luminance
#import bevy_frugal_gi::gi::sources::sky::{SKY_PARTS, SKY_SIDE, SkyLight, sky_direction, sky_place}

struct SkySource {
    /// Quaternion that takes world directions to the map's.
    rotation: vec4<f32>,
    /// Nits that the map's 1 stands for.
    intensity: f32,
    /// Mip level whose texels are about as large as the steps below.
    level: f32,
}

@group(0) @binding(0) var environment: texture_cube<f32>;
@group(0) @binding(1) var environment_sampler: sampler;
@group(0) @binding(2) var<storage, read> source: SkySource;
@group(0) @binding(3) var<storage, read_write> parts: array<SkyLight>;

/// Steps along each side of a part.
const STEPS: u32 = 16u;
/// Nits: whatever a map holds, sums over it stay finite.
const MOST_RADIANCE: f32 = 1e20;

fn rotated(rotation: vec4<f32>, direction: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(rotation.xyz, direction);
    return direction + rotation.w * t + cross(rotation.xyz, t);
}

@compute @workgroup_size(64)
fn fill_sky(@builtin(global_invocation_id) id: vec3<u32>) {
    let corner = vec2<f32>(sky_place(id.x));
    var light = vec3(0.0);
    var toward = vec3(0.0);
    for (var y = 0u; y < STEPS; y++) {
        for (var x = 0u; x < STEPS; x++) {
            let place = corner + (vec2<f32>(vec2(x, y)) + 0.5) / f32(STEPS);
            let direction = sky_direction(place / f32(SKY_SIDE));
            // Cube maps are left-handed, and Bevy turns z round.
            let ray = rotated(source.rotation, direction) * vec3(1.0, 1.0, -1.0);
            let found = textureSampleLevel(environment, environment_sampler, ray, source.level).rgb * source.intensity;
            // What is negative or no number compares false.
            let radiance = select(vec3(0.0), min(found, vec3(MOST_RADIANCE)), found >= vec3(0.0));
            light += radiance;
            // Bounded, so that the square of the sum is finite.
            toward += direction * min(luminance(radiance), 1e15);
        }
    }
    let middle = sky_direction((corner + 0.5) / f32(SKY_SIDE));
    let size = length(toward);
    var part: SkyLight;
    part.direction = select(middle, toward / max(size, 1e-18), size > 1e-18);
    // 4π sr in all.
    part.light = light * (3.1415927 * 12.566371 / f32(SKY_PARTS * STEPS * STEPS));
    parts[id.x] = part;
}

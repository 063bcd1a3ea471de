// Indirect light that a fog volume scatters towards the camera: single scattering, by a march through
// the volume (Hillaire 2015, "Physically Based and Unified Volumetric Rendering in Frostbite": each
// step is integrated in closed form).
//
// The light at a point comes as its mean and its first moment over all directions, so that of the
// phase function the first moment counts: the asymmetry. Sharper peaks are lost.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_render::view::View
#import bevy_frugal_gi::gi::forward::probe::{PLACES, Volume}
#import bevy_frugal_gi::gi::view::noise::{luminance, pixel_noise}
#import bevy_frugal_gi::gi::view::surface::{image_size, pixel_position}

struct Fog {
    /// To the unit cube around the origin.
    local_from_world: mat4x4<f32>,
    /// 1/m, of each channel, where the density texture is 1.
    scattering: vec3<f32>,
    /// Absorption and scattering, 1/m.
    extinction: f32,
    /// Of the density texture, in its widths.
    offset: vec3<f32>,
    /// Mean cosine of scattering, −1 to 1.
    asymmetry: f32,
    steps: u32,
    /// 1 where Bevy does not draw fog, so that it has to hide what lies behind it, else 0.
    hides: f32,
}

@group(0) @binding(0) var depth_buffer: texture_depth_2d;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var<uniform> volume: Volume;
/// See `fog/places.wgsl`.
@group(0) @binding(3) var light: texture_3d<f32>;
@group(0) @binding(4) var light_sampler: sampler;
@group(0) @binding(5) var<uniform> fog: Fog;
#ifdef DENSITY_TEXTURE
@group(0) @binding(6) var density_texture: texture_3d<f32>;
@group(0) @binding(7) var density_sampler: sampler;
#endif

/// Optical depth at which a march ends: less than a hundredth shines through.
const OPAQUE: f32 = 5.0;
/// Metres to what is infinitely far.
const FAR: f32 = 1e9;

/// Radiance that fog at a point scatters along `−along`, for a scattering of 1.
fn scattered(position: vec3<f32>, along: vec3<f32>) -> vec3<f32> {
    let places = vec3<f32>(PLACES);
    // Half a texel from the border, beyond which the other half of the texture begins.
    let place = clamp(position / volume.spacing - vec3<f32>(volume.base), vec3(0.5), places - 0.5);
    let texel = vec3(1.0, 0.5, 1.0) / places;
    let mean = textureSampleLevel(light, light_sampler, place * texel, 0.0);
    let flow = textureSampleLevel(light, light_sampler, place * texel + vec3(0.0, 0.5, 0.0), 0.0);
    let strength = max(luminance(mean.rgb), 1e-9);
    // Not below 0: two moments alone would allow it.
    let ahead = max(1.0 + 3.0 * fog.asymmetry * dot(flow.xyz, along) / strength, 0.0);
    return mean.rgb * (ahead / max(mean.a, 1e-3));
}

fn density(local: vec3<f32>) -> f32 {
#ifdef DENSITY_TEXTURE
    return max(textureSampleLevel(density_texture, density_sampler, local + 0.5 + fog.offset, 0.0).r, 0.0);
#else
    return 1.0;
#endif
}

@fragment
fn scatter(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = image_size(view.viewport);
    let at = vec2<u32>(in.position.xy);
    let pixel = min(at - min(vec2<u32>(view.viewport.xy), at), size - 1u);
    let depth = textureLoad(depth_buffer, at, 0);
    let near = pixel_position(pixel, size, 1.0, view.world_from_clip);
    let along = normalize(pixel_position(pixel, size, 0.5, view.world_from_clip) - near);
    let surface = pixel_position(pixel, size, max(depth, 1e-30), view.world_from_clip);
    let end = select(FAR, dot(surface - near, along), depth > 0.0);
    // The part of the ray within the cube.
    let origin = (fog.local_from_world * vec4(near, 1.0)).xyz;
    let direction = (fog.local_from_world * vec4(along, 0.0)).xyz;
    let inverse = 1.0 / select(direction, vec3(1e-20), abs(direction) < vec3(1e-20));
    let first = (-0.5 - origin) * inverse;
    let second = (0.5 - origin) * inverse;
    let enters = min(first, second);
    let leaves = max(first, second);
    let start = max(max(enters.x, enters.y), max(enters.z, 0.0));
    let stop = min(min(leaves.x, leaves.y), min(leaves.z, end));
    // NaN compares false.
    if !(stop > start) {
        return vec4(0.0);
    }
    let step = min(stop - start, OPAQUE / max(fog.extinction, 1e-9)) / f32(fog.steps);
    let shift = pixel_noise(pixel, 0.0);
    var through = 1.0;
    var sum = vec3(0.0);
    for (var i = 0u; i < fog.steps; i++) {
        let away = start + (f32(i) + shift) * step;
        let position = near + along * away;
        let here = density(origin + direction * away);
        let passes = exp(-fog.extinction * here * step);
        // ∫ exp(−extinction · t) dt over the step.
        let optical = fog.extinction * here;
        let length = select((1.0 - passes) / optical, step, optical * step < 1e-4);
        sum += through * here * length * scattered(position, along);
        through *= passes;
    }
    return vec4(min(sum * fog.scattering, vec3(65000.0)), (1.0 - through) * fog.hides);
}

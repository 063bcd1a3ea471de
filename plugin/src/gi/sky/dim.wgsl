// Bevy's diffuse light of an environment map, dimmed while the gathered sky comes or goes: one thread per
// texel of one face.

/// Faces +X, −X, +Y, −Y, +Z, −Z.
@group(0) @binding(0) var diffuse: texture_2d_array<f32>;
/// Of Bevy's light that is left.
@group(0) @binding(1) var<uniform> share: vec4<f32>;
@group(0) @binding(2) var dimmed: texture_storage_2d_array<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn dim_sky(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(dimmed);
    if any(id.xy >= size) {
        return;
    }
    let light = textureLoad(diffuse, id.xy * textureDimensions(diffuse) / size, id.z, 0).rgb;
    // NaN compares false.
    let kept = select(vec3(0.0), min(light, vec3(65504.0)), light >= vec3(0.0));
    textureStore(dimmed, id.xy, id.z, vec4(kept * share.x, 1.0));
}

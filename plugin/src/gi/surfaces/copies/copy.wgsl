// A texture, averaged into fewer texels for the CPU.

@group(0) @binding(0) var texture: texture_2d<f32>;
// The copy, row by row, four half floats each; then 1 once it is written.
@group(0) @binding(1) var<storage, read_write> copies: array<vec2<u32>>;

struct Size {
    texels: vec2<u32>,
}
@group(0) @binding(2) var<uniform> size: Size;

// Half floats end at 65,504. NaN compares false.
fn finite(color: vec4<f32>) -> vec4<f32> {
    return clamp(select(vec4(0.0), color, abs(color) < vec4(3e38)), vec4(-65504.0), vec4(65504.0));
}

@compute @workgroup_size(8, 8, 1)
fn copy_texture(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= size.texels) {
        return;
    }
    let source = textureDimensions(texture);
    // At least one texel, since copies are not larger.
    let first = id.xy * source / size.texels;
    let end = max((id.xy + 1u) * source / size.texels, first + 1u);
    var sum = vec4(0.0);
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            sum += finite(textureLoad(texture, vec2(x, y), 0));
        }
    }
    let mean = sum / f32((end.x - first.x) * (end.y - first.y));
    copies[id.y * size.texels.x + id.x] = vec2(pack2x16float(mean.xy), pack2x16float(mean.zw));
    if all(id.xy == vec2(0u)) {
        copies[size.texels.x * size.texels.y] = vec2(1u);
    }
}

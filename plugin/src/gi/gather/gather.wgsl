// Sums what a camera's virtual point lights send to its pixels: one thread per gathered pixel, all VPLs.
//
// The VPLs lie in a uniform array whose length is compiled in: on the software adapter 1.75 times as fast as a storage buffer and twice as fast
// as a copy in workgroup memory, and a loop bound taken from a uniform would be compiled anew in each frame there.

#import bevy_render::view::View
#import bevy_frugal_gi::gi::surface::{pixel_position, surface_normal}
#import bevy_frugal_gi::gi::vpl::vpl::Vpl

struct Gather {
    /// Most that the geometry term cosθ·cosθ′/d² may be, 1/m².
    largest_geometry_term: f32,
}

@group(0) @binding(0) var g_buffer: texture_2d<u32>;
@group(0) @binding(1) var depth_buffer: texture_depth_2d;
@group(0) @binding(2) var<uniform> view: View;
@group(0) @binding(3) var<uniform> vpls: array<Vpl, #{VPL_COUNT}>;
@group(0) @binding(4) var<uniform> gather: Gather;
@group(0) @binding(5) var irradiance: texture_storage_2d<rgba16float, write>;

/// The pixel that stands for a cell.
fn representative(cell: vec2<u32>, size: vec2<u32>) -> vec2<u32> {
    let step = vec2(#{CELL_WIDTH}u, #{CELL_HEIGHT}u);
    return min(cell * step + step / 2u, size - 1u);
}

/// Irradiance from one VPL, without the factor 1/π that its cosine lobe and the sum share. Lux · π.
fn from_vpl(vpl: Vpl, position: vec3<f32>, normal: vec3<f32>, largest: f32) -> vec3<f32> {
    let way = vpl.position - position;
    // Two divisions by d² rather than one by d⁴ keep every distance from 1e-9 m to 1e19 m in range; at distance 0 both cosines are 0.
    let inverse = 1.0 / clamp(dot(way, way), 1e-18, 1e38);
    let receiver = max(dot(normal, way), 0.0) * inverse;
    let emitter = max(-dot(vpl.normal, way), 0.0) * inverse;
    return vpl.flux * min(receiver * emitter, largest);
}

@compute @workgroup_size(8, 8)
fn gather_vpls(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = textureDimensions(irradiance);
    if any(id.xy >= cells) {
        return;
    }
    let size = textureDimensions(g_buffer);
    let pixel = representative(id.xy, size);
    let depth = textureLoad(depth_buffer, pixel, 0);
    if depth == 0.0 {
        textureStore(irradiance, id.xy, vec4(0.0));
        return;
    }
    let position = pixel_position(pixel, size, depth, view.world_from_clip);
    let normal = surface_normal(textureLoad(g_buffer, pixel, 0));
    var sum = vec3(0.0);
    for (var i = 0u; i < #{VPL_COUNT}u; i++) {
        sum += from_vpl(vpls[i], position, normal, gather.largest_geometry_term);
    }
    // Exposed before it is stored, so that half floats hold any scene; what is brighter than they can hold is white anyway.
    let exposed = min(sum * (view.exposure * 0.31830987), vec3(65000.0));
    textureStore(irradiance, id.xy, vec4(exposed, 1.0));
}

// Upscales a camera's image to its target.

#import bevy_core_pipeline::fullscreen_vertex_shader::FullscreenVertexOutput
#import bevy_frugal_gi::resolution::catmull_rom::catmull_rom

@group(0) @binding(0) var source_texture: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;

@fragment
fn upscale(in: FullscreenVertexOutput) -> @location(0) vec4<f32> {
    let size = vec2<f32>(textureDimensions(source_texture));
    return catmull_rom(source_texture, source_sampler, in.uv * size);
}

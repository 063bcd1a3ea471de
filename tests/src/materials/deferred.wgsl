// A diffuse surface of one colour, written to the G-buffer without Bevy's material.

#import bevy_pbr::pbr_deferred_functions::deferred_output
#import bevy_pbr::pbr_types::pbr_input_new
#import bevy_pbr::prepass_io::{VertexOutput, FragmentOutput}

@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> color: vec4<f32>;

@fragment
fn fragment(in: VertexOutput) -> FragmentOutput {
    var input = pbr_input_new();
    input.frag_coord = in.position;
    input.world_position = in.world_position;
    input.N = normalize(in.world_normal);
    input.material.base_color = color;
    input.material.perceptual_roughness = 1.0;
    input.material.reflectance = vec3(0.0);
    return deferred_output(in, input);
}

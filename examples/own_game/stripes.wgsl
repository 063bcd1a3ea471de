// Bevy's standard material with stripes across the base colour.

#import bevy_pbr::pbr_fragment::pbr_input_from_standard_material
#ifdef PREPASS_PIPELINE
#import bevy_pbr::prepass_io::{VertexOutput, FragmentOutput}
#import bevy_pbr::pbr_deferred_functions::deferred_output
#else
#import bevy_pbr::forward_io::{VertexOutput, FragmentOutput}
#import bevy_pbr::pbr_functions::{apply_pbr_lighting, main_pass_post_lighting_processing}
#endif

// Linear colour, and stripes per metre.
@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> stripes: vec4<f32>;

@fragment
fn fragment(in: VertexOutput, @builtin(front_facing) is_front: bool) -> FragmentOutput {
    var input = pbr_input_from_standard_material(in, is_front);
    if fract(input.world_position.y * stripes.w) < 0.5 {
        input.material.base_color = vec4(stripes.rgb, 1.0);
    }
#ifdef PREPASS_PIPELINE
    return deferred_output(in, input);
#else
    var out: FragmentOutput;
    out.color = main_pass_post_lighting_processing(input, apply_pbr_lighting(input));
    return out;
#endif
}

// Displaces a mesh in every prepass.

#import bevy_pbr::mesh_functions::{get_world_from_local, mesh_normal_local_to_world, mesh_position_local_to_world}
#import bevy_pbr::prepass_io::{Vertex, VertexOutput}
#import bevy_pbr::view_transformations::position_world_to_clip

@group(#{MATERIAL_BIND_GROUP}) @binding(100) var<uniform> by: vec4<f32>;

@vertex
fn vertex(vertex: Vertex) -> VertexOutput {
    var out: VertexOutput;
    let world_from_local = get_world_from_local(vertex.instance_index);
    out.world_position = mesh_position_local_to_world(world_from_local, vec4(vertex.position, 1.0)) + vec4(by.xyz, 0.0);
    out.position = position_world_to_clip(out.world_position.xyz);
#ifdef NORMAL_PREPASS_OR_DEFERRED_PREPASS
#ifdef VERTEX_NORMALS
    out.world_normal = mesh_normal_local_to_world(vertex.normal, vertex.instance_index);
#endif
#endif
#ifdef VERTEX_OUTPUT_INSTANCE_INDEX
    out.instance_index = vertex.instance_index;
#endif
    return out;
}

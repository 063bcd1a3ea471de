//! Structs of the shaders have the sizes that the plugin assumes.

use bevy_frugal_gi::gi::inspect::STRUCT_BYTES;

tests!(structs_have_the_sizes_that_buffers_assume, the_check_detects_a_larger_struct);

const SHADERS: [&str; 11] = [
    include_str!("../../../plugin/src/gi/texels/texel.wgsl"),
    include_str!("../../../plugin/src/gi/vpl/vpl.wgsl"),
    include_str!("../../../plugin/src/gi/texels/rows.wgsl"),
    include_str!("../../../plugin/src/gi/vpl/importance.wgsl"),
    include_str!("../../../plugin/src/gi/vpl/plan.wgsl"),
    include_str!("../../../plugin/src/gi/gather/settings.wgsl"),
    include_str!("../../../plugin/src/gi/trace/trace.wgsl"),
    include_str!("../../../plugin/src/gi/rsm/resolve.wgsl"),
    include_str!("../../../plugin/src/gi/bounces/patch.wgsl"),
    include_str!("../../../plugin/src/gi/sky/sky.wgsl"),
    include_str!("../../../plugin/src/gi/sky/fill.wgsl"),
];

/// Size of the struct `name` in a buffer, in bytes, by the shader compiler. The struct is extracted
/// from its file, because imports are not plain WGSL.
fn size(name: &str, sources: &[&str]) -> u32 {
    let start = format!("struct {name} {{");
    let text = sources.iter().find_map(|source| source.find(&start).map(|at| &source[at..]));
    let text = text.unwrap_or_else(|| panic!("no shader has a struct {name}"));
    let text = &text[..=text.find("\n}").unwrap_or_else(|| panic!("struct {name} has no end")) + 1];
    let module =
        naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{name}: {error}"));
    module
        .types
        .iter()
        .find_map(|(_, kind)| match &kind.inner {
            // The span includes padding to the alignment, as in an array.
            naga::TypeInner::Struct { span, .. } => Some(*span),
            _ => None,
        })
        .unwrap_or_else(|| panic!("struct {name} is gone"))
}

fn structs_have_the_sizes_that_buffers_assume() {
    for (name, bytes) in STRUCT_BYTES {
        assert_eq!(u64::from(size(name, &SHADERS)), bytes, "{name}");
    }
}

fn the_check_detects_a_larger_struct() {
    let grown = SHADERS[1].replace("padding: f32,", "padding: f32,\n    more: f32,");
    assert_eq!(size("Vpl", &[&grown]), 64);
}
